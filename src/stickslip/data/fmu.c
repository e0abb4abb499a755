#define FRICTION_MODES $modes
#define FRICTION_EXITS $exits
#define ON_BASE $on_base
static const int holds[FRICTION_MODES] = { $holds };
static const double held_speed[FRICTION_MODES] = { $speeds };
static const double begins[$count] = { $begins };
static const double sizes[] = { $sizes };

#define PASSED 1e-12
static void friction_exits(const friction_state *s, const friction_motion *in, double *z)
{
    const double force = friction_force(s, in);
    (void)force; (void)z;
    switch (s->mode) {
$ends    default: break;
    }
}


/* ---- one mass that rubs, as a functional mock-up unit: model exchange and co-simulation of FMI 3.0

   mass x'' = force + stiffness (z - x) + damping (z' - x') - friction        (a damper on the ground: without z')

   Friction is that of x against a counter-face that moves by face_speed. From when it was set force is held, and z goes on
   by z_rate. The step of a co-simulation is of Dormand and Prince (1980), and ends where a mode of the friction ends. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined _WIN32
#define FMI __declspec(dllexport)
#else
#define FMI __attribute__((visibility("default")))
#endif

enum { FORCE = 1, Z, Z_RATE, MASS, STIFFNESS, DAMPING, FACE_SPEED, X, V, MEMORY };
enum { FRICTION = MEMORY + FRICTION_MEMORY, ACCELERATION, MEMORY_RATE, MODE = MEMORY_RATE + FRICTION_MEMORY };
enum { STATES = 2 + FRICTION_MEMORY, OK = 0, ERROR = 3, STAGES = 7 };
#define TOLERANCE 1e-10 /* of a step, relative to the largest value that each state has had */
#define PER_SWING 40    /* steps at least in a natural period, so that no reversal is stepped over */
#define HALVINGS 200    /* at most, until the instant at which a mode ends is known to the last digit */

typedef struct {
    double time, since, start;  /* [s]: now, when the inputs were set, when it began */
    double value[MEMORY];       /* by value reference, x and v among them */
    friction_state contact;
    double largest[STATES], step;
    bool initialised;
} slider;

static double pull(const slider *s)
{
    const double *p = s->value, z = p[Z] + p[Z_RATE] * (s->time - s->since);
    return p[FORCE] + p[STIFFNESS] * (z - p[X]) + p[DAMPING] * (ON_BASE * p[Z_RATE] - p[V]);
}

static friction_motion motion(const slider *s)
{
    const double *p = s->value;
    const double speed = p[V] - p[FACE_SPEED], hold_rate = p[STIFFNESS] * (p[Z_RATE] - p[V]);
    const friction_motion in = { p[X] - p[FACE_SPEED] * (s->time - s->start), speed, pull(s), hold_rate, 0.0, 0.0 };
    return in;
}

static void get_states(const slider *s, double *y)
{
    y[0] = s->value[X]; y[1] = s->value[V];
    memcpy(y + 2, s->contact.memory, FRICTION_MEMORY * sizeof *y);
}

static void set_states(slider *s, const double *y)
{
    s->value[X] = y[0]; s->value[V] = y[1];
    memcpy(s->contact.memory, y + 2, FRICTION_MEMORY * sizeof *y);
}

/* A step may try a speed against the side to which the mass slides, where a power of it is no number: it is then 0. */
static friction_motion within(const slider *s)
{
    friction_motion in = motion(s);
    if (isnan(friction_force(&s->contact, &in))) in.v = 0.0;
    return in;
}

static void rates(const slider *s, double *dy)
{
    const friction_motion in = within(s);
    dy[0] = s->value[V];
    dy[1] = (in.hold - friction_force(&s->contact, &in)) / s->value[MASS];
    friction_rates(&s->contact, &in, dy + 2);
}

/* Whether a mode ends here; what only counts once it was below zero is armed. */
static bool leaves(slider *s)
{
    const friction_motion in = motion(s);
    if (!friction_leave(&s->contact, &in)) return false;
    if (holds[s->contact.mode]) s->value[V] = s->value[FACE_SPEED] + held_speed[s->contact.mode];
    return true;
}

static bool due(const slider *s)
{
    slider copy = *s;
    return leaves(&copy);
}

static bool settle(slider *s)
{
    int i, left = 0;
    for (i = 0; i <= FRICTION_MODES && leaves(s); i++) left++;
    return left > 0;
}

/* A step of Dormand and Prince from s; told is its error over what is allowed. */
static double stepped(const slider *s, double h, slider *next)
{
    static const double node[STAGES] = { 0, 1/5., 3/10., 4/5., 8/9., 1, 1 };
    static const double part[STAGES][6] = {
        { 0 }, { 1/5. }, { 3/40., 9/40. }, { 44/45., -56/15., 32/9. },
        { 19372/6561., -25360/2187., 64448/6561., -212/729. },
        { 9017/3168., -355/33., 46732/5247., 49/176., -5103/18656. },
        { 35/384., 0, 500/1113., 125/192., -2187/6784., 11/84. } };
    static const double apart[STAGES] = { 71/57600., 0, -71/16695., 71/1920., -17253/339200., 22/525., -1/40. };
    double begin[STATES], y[STATES], slope[STAGES][STATES], worst = 0.0;
    int i, j, k;
    get_states(s, begin);
    *next = *s;
    for (k = 0; k < STAGES; k++) {
        for (i = 0; i < STATES; i++) {
            y[i] = begin[i];
            for (j = 0; j < k; j++) y[i] += h * part[k][j] * slope[j][i];
        }
        next->time = s->time + node[k] * h;
        set_states(next, y);
        rates(next, slope[k]);
    }
    for (i = 0; i < STATES; i++) {
        double error = 0.0, size = fabs(h * slope[0][i]);
        for (k = 0; k < STAGES; k++) error += h * apart[k] * slope[k][i];
        size = fmax(fmax(size, s->largest[i]), fabs(y[i]));
        next->largest[i] = fmax(s->largest[i], fabs(y[i]));
        error = fabs(error) / (TOLERANCE * size + 1e-300);
        worst = error <= worst ? worst : error; /* also where it is no number */
    }
    return worst;
}

/* The first instant at which a mode is over, within a step that has its end in it. */
static slider over(const slider *s, double h)
{
    double low = 0.0, high = h;
    slider end, tried;
    int i;
    stepped(s, high, &end);
    for (i = 0; i < HALVINGS; i++) {
        const double middle = 0.5 * (low + high);
        if (s->time + middle <= s->time + low || s->time + middle >= s->time + high) break;
        stepped(s, middle, &tried);
        if (due(&tried)) { high = middle; end = tried; } else low = middle;
    }
    return end;
}

static bool advance(slider *s, double end)
{
    const double longest = 6.283185307179586 * sqrt(s->value[MASS] / fmax(s->value[STIFFNESS], 1e-300)) / PER_SWING;
    settle(s);
    while (s->time < end) {
        const double left = end - s->time, h = fmin(fmin(s->step > 0 ? s->step : left, longest), left);
        slider next;
        const double error = stepped(s, h, &next), grown = error > 0 ? 0.9 * pow(error, -0.2) : 5.0;
        if (!(error <= 1.0) && s->time + 0.1 * h > s->time) {
            s->step = h * (error > 1.0 ? fmax(grown, 0.2) : 0.1);
            continue;
        }
        if (!(error <= 1.0)) return false;
        if (due(&next)) next = over(s, h);
        else if (h == left) next.time = end;
        next.step = h * fmin(fmax(grown, 0.2), 5.0);
        *s = next;
        settle(s);
    }
    return true;
}

/* ---- the interface */

typedef slider *fmi3Instance;
typedef const slider *fmi3Constant;
typedef uint32_t fmi3ValueReference;
typedef int fmi3Status;
typedef const char *fmi3String;

static slider *made(fmi3String token)
{
    slider *s = strcmp(token, TOKEN) ? NULL : calloc(1, sizeof *s);
    if (s) memcpy(s->value, begins, sizeof begins);
    return s;
}

FMI const char *fmi3GetVersion(void) { return "3.0"; }
FMI fmi3Status fmi3SetDebugLogging(fmi3Instance s, bool on, size_t n, const fmi3String *categories)
{ (void)s; (void)on; (void)n; (void)categories; return OK; }
FMI fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String path, bool visible,
    bool logging, void *environment, void *log)
{ (void)name; (void)path; (void)visible; (void)logging; (void)environment; (void)log; return made(token); }
FMI fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, bool visible,
    bool logging, bool events, bool early, const fmi3ValueReference *needed, size_t n, void *environment, void *log,
    void *update)
{
    (void)name; (void)path; (void)visible; (void)logging; (void)events; (void)early; (void)needed; (void)n;
    (void)environment; (void)log; (void)update;
    return made(token);
}
FMI fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String path, bool visible,
    bool logging, void *environment, void *log, void *clock, void *lock, void *unlock)
{
    (void)name; (void)token; (void)path; (void)visible; (void)logging; (void)environment; (void)log; (void)clock;
    (void)lock; (void)unlock;
    return NULL;
}
FMI void fmi3FreeInstance(fmi3Instance s) { free(s); }
FMI fmi3Status fmi3EnterInitializationMode(fmi3Instance s, bool toleranceDefined, double tolerance, double startTime,
    bool stopTimeDefined, double stopTime)
{
    (void)toleranceDefined; (void)tolerance; (void)stopTimeDefined; (void)stopTime;
    s->time = s->since = s->start = startTime;
    return OK;
}

static void begun(slider *s)
{
    friction_motion in = motion(s);
    s->contact = friction_start(&in);
    if (holds[s->contact.mode]) s->value[V] = s->value[FACE_SPEED] + held_speed[s->contact.mode];
}

FMI fmi3Status fmi3ExitInitializationMode(fmi3Instance s)
{
    if (!(s->value[MASS] > 0)) return ERROR;
    begun(s);
    settle(s);
    s->initialised = true;
    return OK;
}
FMI fmi3Status fmi3EnterEventMode(fmi3Instance s) { (void)s; return OK; }
FMI fmi3Status fmi3Terminate(fmi3Instance s) { (void)s; return OK; }
FMI fmi3Status fmi3Reset(fmi3Instance s)
{
    memset(s, 0, sizeof *s);
    memcpy(s->value, begins, sizeof begins);
    return OK;
}

/* What ends the mode where it rises above zero; -1 where the mode has fewer of that than others. */
static void ends(const slider *s, double *z)
{
    const friction_motion in = motion(s);
    int i;
    for (i = 0; i < FRICTION_EXITS; i++) z[i] = -1.0;
    friction_exits(&s->contact, &in, z);
}

static bool given(fmi3Constant s, fmi3ValueReference which, double *value)
{
    double dy[STATES];
    slider first = *s;
    if (!s->initialised) begun(&first);
    rates(&first, dy);
    if (which == 0) *value = s->time;
    else if (which < MEMORY) *value = first.value[which];
    else if (which < FRICTION) *value = first.contact.memory[which - MEMORY];
    else if (which == FRICTION) {
        const friction_motion in = within(&first);
        *value = friction_force(&first.contact, &in);
    }
    else if (which == ACCELERATION) *value = dy[1];
    else if (which < MODE) *value = dy[2 + which - MEMORY_RATE];
    else if (which > MODE && which <= MODE + FRICTION_EXITS) {
        double z[FRICTION_EXITS];
        ends(&first, z);
        *value = z[which - MODE - 1];
    }
    else return false;
    return true;
}

FMI fmi3Status fmi3GetFloat64(fmi3Instance s, const fmi3ValueReference *which, size_t n, double *values, size_t m)
{
    size_t i;
    (void)m;
    for (i = 0; i < n; i++) if (!given(s, which[i], values + i)) return ERROR;
    return OK;
}
FMI fmi3Status fmi3SetFloat64(fmi3Instance s, const fmi3ValueReference *which, size_t n, const double *values,
    size_t m)
{
    size_t i;
    (void)m;
    for (i = 0; i < n; i++) {
        if (which[i] < 1 || which[i] >= MEMORY || (s->initialised && which[i] > Z_RATE)) return ERROR;
        s->value[which[i]] = values[i];
    }
    s->since = s->time;
    return OK;
}
FMI fmi3Status fmi3GetInt32(fmi3Instance s, const fmi3ValueReference *which, size_t n, int32_t *values, size_t m)
{
    size_t i;
    (void)m;
    for (i = 0; i < n; i++) {
        slider first = *s;
        if (which[i] != MODE) return ERROR;
        if (!s->initialised) begun(&first);
        values[i] = first.contact.mode;
    }
    return OK;
}

/* What no variable of this model has a type for. */
#define NONE_OF(name, type)                                                                                          \
    FMI fmi3Status fmi3Get##name(fmi3Instance s, const fmi3ValueReference *r, size_t n, type *v, size_t m)           \
    { (void)s; (void)r; (void)v; (void)m; return n ? ERROR : OK; }                                                   \
    NOT_SET(name, type)
#define NOT_SET(name, type)                                                                                          \
    FMI fmi3Status fmi3Set##name(fmi3Instance s, const fmi3ValueReference *r, size_t n, const type *v, size_t m)     \
    { (void)s; (void)r; (void)v; (void)m; return n ? ERROR : OK; }
NONE_OF(Float32, float) NONE_OF(Int8, int8_t) NONE_OF(UInt8, uint8_t) NONE_OF(Int16, int16_t)
NONE_OF(UInt16, uint16_t) NOT_SET(Int32, int32_t) NONE_OF(UInt32, uint32_t) NONE_OF(Int64, int64_t)
NONE_OF(UInt64, uint64_t) NONE_OF(Boolean, bool) NONE_OF(String, fmi3String)
#define REFUSED(name, ...) FMI fmi3Status fmi3##name(fmi3Instance s, __VA_ARGS__) { (void)s; return ERROR; }
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
REFUSED(GetBinary, const fmi3ValueReference *r, size_t n, size_t *sizes, const uint8_t **v, size_t m)
REFUSED(SetBinary, const fmi3ValueReference *r, size_t n, const size_t *sizes, const uint8_t *const *v, size_t m)
REFUSED(GetClock, const fmi3ValueReference *r, size_t n, bool *v)
REFUSED(SetClock, const fmi3ValueReference *r, size_t n, const bool *v)
REFUSED(GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *n)
REFUSED(GetVariableDependencies, fmi3ValueReference r, size_t *i, fmi3ValueReference *q, size_t *j, int *k, size_t n)
REFUSED(GetDirectionalDerivative, const fmi3ValueReference *r, size_t n, const fmi3ValueReference *q, size_t m,
    const double *seed, size_t i, double *v, size_t j)
REFUSED(GetAdjointDerivative, const fmi3ValueReference *r, size_t n, const fmi3ValueReference *q, size_t m,
    const double *seed, size_t i, double *v, size_t j)
REFUSED(GetIntervalDecimal, const fmi3ValueReference *r, size_t n, double *v, int *q)
REFUSED(GetIntervalFraction, const fmi3ValueReference *r, size_t n, uint64_t *c, uint64_t *d, int *q)
REFUSED(GetShiftDecimal, const fmi3ValueReference *r, size_t n, double *v)
REFUSED(GetShiftFraction, const fmi3ValueReference *r, size_t n, uint64_t *c, uint64_t *d)
REFUSED(SetIntervalDecimal, const fmi3ValueReference *r, size_t n, const double *v)
REFUSED(SetIntervalFraction, const fmi3ValueReference *r, size_t n, const uint64_t *c, const uint64_t *d)
REFUSED(SetShiftDecimal, const fmi3ValueReference *r, size_t n, const double *v)
REFUSED(SetShiftFraction, const fmi3ValueReference *r, size_t n, const uint64_t *c, const uint64_t *d)
REFUSED(GetOutputDerivatives, const fmi3ValueReference *r, size_t n, const int32_t *o, double *v, size_t m)
REFUSED(ActivateModelPartition, fmi3ValueReference r, double time)
FMI fmi3Status fmi3EnterConfigurationMode(fmi3Instance s) { return OK; }
FMI fmi3Status fmi3ExitConfigurationMode(fmi3Instance s) { return OK; }
FMI fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance s) { return OK; }
FMI fmi3Status fmi3EnterStepMode(fmi3Instance s) { return OK; }
FMI fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance s) { return OK; }

FMI fmi3Status fmi3GetFMUState(fmi3Instance s, void **state)
{
    if (!*state && !(*state = malloc(sizeof *s))) return ERROR;
    memcpy(*state, s, sizeof *s);
    return OK;
}
FMI fmi3Status fmi3SetFMUState(fmi3Instance s, void *state) { memcpy(s, state, sizeof *s); return OK; }
FMI fmi3Status fmi3FreeFMUState(fmi3Instance s, void **state) { free(*state); *state = NULL; return OK; }
FMI fmi3Status fmi3SerializedFMUStateSize(fmi3Instance s, void *state, size_t *size) { *size = sizeof *s; return OK; }
FMI fmi3Status fmi3SerializeFMUState(fmi3Instance s, void *state, uint8_t *bytes, size_t size)
{ if (size < sizeof *s) return ERROR; memcpy(bytes, state, sizeof *s); return OK; }
FMI fmi3Status fmi3DeserializeFMUState(fmi3Instance s, const uint8_t *bytes, size_t size, void **state)
{
    if (size != sizeof *s || (!*state && !(*state = malloc(sizeof *s)))) return ERROR;
    memcpy(*state, bytes, sizeof *s);
    return OK;
}

FMI fmi3Status fmi3UpdateDiscreteStates(fmi3Instance s, bool *again, bool *end, bool *nominals, bool *values,
    bool *nextDefined, double *next)
{
    *again = *end = *nominals = *nextDefined = false;
    *next = 0.0;
    *values = settle(s);
    return OK;
}
FMI fmi3Status fmi3CompletedIntegratorStep(fmi3Instance s, bool final, bool *event, bool *end)
{
    *end = false;
    *event = due(s);
    if (!*event) leaves(s); /* arms what has gone below zero */
    return OK;
}
FMI fmi3Status fmi3SetTime(fmi3Instance s, double time) { s->time = time; return OK; }
FMI fmi3Status fmi3SetContinuousStates(fmi3Instance s, const double *y, size_t n) { set_states(s, y); return OK; }
FMI fmi3Status fmi3GetContinuousStates(fmi3Instance s, double *y, size_t n) { get_states(s, y); return OK; }
FMI fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance s, double *dy, size_t n) { rates(s, dy); return OK; }
FMI fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance s, double *nominals, size_t n)
{ memcpy(nominals, sizes, n * sizeof *nominals); return OK; }
FMI fmi3Status fmi3GetEventIndicators(fmi3Instance s, double *z, size_t n)
{ ends(s, z); return OK; }
FMI fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance s, size_t *n) { *n = FRICTION_EXITS; return OK; }
FMI fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance s, size_t *n) { *n = STATES; return OK; }
FMI fmi3Status fmi3DoStep(fmi3Instance s, double time, double size, bool final, bool *event, bool *end, bool *early,
    double *last)
{
    bool done;
    *event = *end = *early = false;
    done = advance(s, time + size);
    *last = s->time;
    return done ? OK : ERROR;
}
