/* The floor under the engine: one oscillator on one contact, written out by hand for this case alone.

   m x'' + c x' + k x + f = k Z cos(w t), underdamped, from rest. Rigid contact (contact = 0): slip of either side and
   stick; compliant contact: slip and microstick. A mode's exits are forms g = g0 + u x + y v, positive inside. The
   root: the duration of the same event one cycle before, polished by Halley; or a march by lower bounds. The
   certificate that no root comes sooner: cubic bounds from both ends in Bernstein form, halved where they do not meet. */
#include <math.h>

typedef struct { double d, turn, rate, p, q, w, forced; } mode_t; /* decay, W, k/m, forced part p cos + q sin */
typedef struct { const mode_t *m; double shift, a, b, t0, x2, x3, x4; } path_t; /* x2..x4 bound the derivatives */
typedef struct { double x, v, a, j, c, s; } motion_t; /* with the drive's phasor */
typedef struct { double g0, u, y; } form_t;

#define SLOTS 64

static mode_t mode(double mass, double spring, double loss, double push, double w)
{
    mode_t m = {loss / (2 * mass), 0, spring / mass, 0, 0, w, 0};
    double real = m.rate - w * w, imag = 2 * m.d * w, size = real * real + imag * imag;
    m.turn = sqrt(m.rate - m.d * m.d);
    m.p = push / mass * real / size;
    m.q = push / mass * imag / size;
    m.forced = sqrt(m.p * m.p + m.q * m.q);
    return m;
}

static path_t begin(const mode_t *m, double t0, double c, double s, double x, double v, double shift, motion_t *at)
{
    double w = m->w, own = sqrt(m->rate), f = m->p * c + m->q * s, df = w * (m->q * c - m->p * s);
    path_t path = {m, shift, x - shift - f, 0, t0, 0, 0, 0};
    path.b = (v - df + m->d * path.a) / m->turn;
    double ddy = -m->rate * path.a - 2 * m->d * (v - df);
    motion_t first = {x, v, -w * w * f + ddy, -w * w * df - m->rate * (v - df) - 2 * m->d * ddy, c, s};
    *at = first;
    double free = m->rate * sqrt(path.a * path.a + path.b * path.b);
    path.x2 = w * w * m->forced + free;
    path.x3 = w * w * w * m->forced + own * free;
    path.x4 = w * w * w * w * m->forced + own * own * free;
    return path;
}

static inline motion_t look(const path_t *path, double t)
{
    const mode_t *m = path->m;
    double angle = m->w * (path->t0 + t), c = cos(angle), s = sin(angle), w = m->w;
    double e = exp(-m->d * t), cc = e * cos(m->turn * t), ss = e * sin(m->turn * t);
    double y = path->a * cc + path->b * ss, dy = m->turn * (path->b * cc - path->a * ss) - m->d * y;
    double f = m->p * c + m->q * s, df = w * (m->q * c - m->p * s), ddy = -m->rate * y - 2 * m->d * dy;
    motion_t at = {path->shift + f + y, df + dy, -w * w * f + ddy, -w * w * df - m->rate * dy - 2 * m->d * ddy, c, s};
    return at;
}

#define G(f, s) ((f)->g0 + (f)->u * (s).x + (f)->y * (s).v)
#define D(f, s) ((f)->u * (s).v + (f)->y * (s).a)
#define DD(f, s) ((f)->u * (s).a + (f)->y * (s).j)

/* whether g stays above zero between two instants; g is zero at the very ends where `from` or `to` say so */
static int inside(const path_t *path, const form_t *f, double t0, motion_t s0, int from, double t1, motion_t s1, int to,
                  int depth)
{
    double h = (t1 - t0) / 2, k = fabs(f->u) * path->x3 + fabs(f->y) * path->x4, drop = k * h * h * h / 6;
    double g = from ? 0 : G(f, s0), d = D(f, s0) * h, dd = DD(f, s0) * h * h / 2;
    double e = to ? 0 : G(f, s1), c = -D(f, s1) * h, cc = DD(f, s1) * h * h / 2;
    double tiny = -1e-13 * (fabs(d) + fabs(dd));
    if (g + d / 3 >= tiny && g + 2 * d / 3 + dd / 3 >= 0 && g + d + dd - drop > 0 && e + c / 3 >= 0 &&
        e + 2 * c / 3 + cc / 3 >= 0 && e + c + cc - drop > 0)
        return 1;
    if (!depth)
        return 0;
    motion_t half = look(path, t0 + h);
    return G(f, half) > 0 && inside(path, f, t0, s0, from, t0 + h, half, 0, depth - 1) &&
           inside(path, f, t0 + h, half, 0, t1, s1, to, depth - 1);
}

/* from a time near the root to the root; the state comes along */
static int polish(const path_t *path, const form_t *f, double *t, motion_t *at)
{
    double near = 3e-6 / sqrt(path->m->rate + path->m->w * path->m->w), far = 1e5 * near;
    for (int turn = 0; turn < 6; turn++) {
        *at = look(path, *t);
        double g = G(f, *at), d = D(f, *at), dd = DD(f, *at), dt = -2 * g * d / (2 * d * d - g * dd);
        if (!(d < 0) || !(fabs(dt) < far) || *t + dt <= 0)
            return 0;
        *t += dt;
        if (fabs(dt) < near) {
            at->x += dt * (at->v + dt / 2 * (at->a + dt / 3 * at->j));
            at->v += dt * (at->a + dt / 2 * at->j);
            at->a += dt * at->j;
            double turned = path->m->w * dt, c = at->c;
            at->c -= turned * (at->s + turned / 2 * c);
            at->s += turned * (c - turned / 2 * at->s);
            return 1;
        }
    }
    return 0;
}

/* the first root after 0 by steps that can not jump over one */
static int march(const path_t *path, const form_t *f, int forms, int zero, motion_t s0, double *t, motion_t *at)
{
    double scale = 1 / sqrt(path->m->rate + path->m->w * path->m->w);
    *t = 0;
    *at = s0;
    for (int turn = 0; turn < 100000; turn++) {
        double step = 1e300;
        int which = 0;
        for (int j = 0; j < forms; j++) {
            double g = G(&f[j], *at), d = D(&f[j], *at), h;
            if (turn == 0 && j == zero) {
                double dd = DD(&f[j], *at), k = fabs(f[j].u) * path->x3 + fabs(f[j].y) * path->x4;
                if (d < 0)
                    d = 0;
                h = 0.9 * (dd / 2 + sqrt(dd * dd / 4 + 2 * k * d / 3)) * 3 / k;
            } else {
                double k = fabs(f[j].u) * path->x2 + fabs(f[j].y) * path->x3;
                h = (d + sqrt(d * d + 2 * k * fmax(g, 0))) / k;
            }
            if (h < step)
                step = h, which = j;
        }
        double aim = *t + step;
        if (turn && step < 1e-4 * scale && polish(path, &f[which], &aim, at) && fabs(aim - *t) < 2.5 * step) {
            *t = aim;
            return which;
        }
        *t += fmax(step, 1e-12 * scale);
        *at = look(path, *t);
    }
    return -1;
}

long run(double mass, double spring, double loss, double z, double w, double level, double contact, double contact_loss,
         double cycles, long room, double *times, int *modes)
{
    const double period = 2 * M_PI / w;
    const mode_t slip = mode(mass, spring, loss, spring * z, w);
    const mode_t held = mode(mass, spring + contact, loss + contact_loss, spring * z, w);
    double guess[SLOTS], lap = 0, t0 = 0, c = 1, s = 0, x = 0, v = 0, anchor = 0;
    int way[SLOTS], known = 0, slot = 0, entered = -1;
    int side = contact == 0 && spring * z > level;
    long count = 0;
    for (;;) {
        double t = 0;
        motion_t at = {x, 0, 0, 0, 0, 0};
        int next = 0;
        if (side == 0 && contact == 0) {
            double up = x / z + level / (spring * z), down = x / z - level / (spring * z), phase = w * t0;
            double a = fabs(up) <= 1 ? 2 * M_PI - acos(up) - phase : 1e9, b = fabs(down) <= 1 ? acos(down) - phase : 1e9;
            a += a <= 0 ? 2 * M_PI : 0;
            b += b <= 0 ? 2 * M_PI : 0;
            t = (a < b ? a : b) / w;
            next = a < b ? 1 : -1;
            at.c = a < b ? up : down;
            at.s = -next * sqrt(1 - at.c * at.c);
        } else {
            const mode_t *m = side ? &slip : &held;
            double shift = side ? -side * level / spring : contact * anchor / (spring + contact);
            motion_t s0;
            path_t path = begin(m, t0, c, s, x, v, shift, &s0);
            form_t forms[2] = {{0, 0, side}};
            int which = -1, size = 1, zero = contact == 0 ? 0 : -1;
            if (!side) {
                form_t both[2] = {{level + contact * anchor, -contact, -contact_loss},
                                  {level - contact * anchor, contact, contact_loss}};
                forms[0] = both[0], forms[1] = both[1], size = 2, zero = entered;
            }
            if (slot < known && way[slot] >= 0) {
                t = guess[slot];
                which = way[slot];
                if (which >= size || !polish(&path, &forms[which], &t, &at))
                    which = -1;
                for (int j = 0; which >= 0 && j < size; j++)
                    if (!inside(&path, &forms[j], 0, s0, j == zero, t, at, j == which, 12))
                        which = -1;
            }
            if (which < 0)
                which = march(&path, forms, size, zero, s0, &t, &at);
            if (which < 0)
                return -1;
            guess[slot] = t;
            way[slot] = which;
            next = side ? 0 : which == 0 ? 1 : -1;
        }
        if (contact == 0 && side == 0)
            way[slot] = -1;
        slot = slot < SLOTS - 1 ? slot + 1 : slot;
        t0 += t;
        while (t0 >= period)
            t0 -= period, lap += 1, known = slot, slot = 0;
        if (lap >= cycles)
            return count;
        x = at.x;
        c = at.c;
        s = at.s;
        v = side ? 0 : at.v;
        if (side && contact == 0) {
            double needed = spring * (z * c - x);
            next = fabs(needed) <= level ? 0 : needed > 0 ? 1 : -1;
        } else if (side) {
            anchor = x - side * level / contact;
            entered = side > 0 ? 0 : 1;
        }
        side = next;
        if (count < room) {
            times[count] = lap * period + t0;
            modes[count] = side;
        }
        count++;
    }
}
