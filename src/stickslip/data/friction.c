/* $formula

   Friction [N], positive against positive velocity. Motion: x [m] and v [m/s] of the mass against the counter-face;
   hold [N] and hold_rate [N/s]: the force that keeps the mass at rest, as the rest of the model has it, and its rate;
   a mode whose friction is hold has v = 0. delayed_speed [m/s]: the speed a lag ago, of a law with a lag.
   face_acceleration [m/s^2]: of the counter-face, of a contact with a mass.

   friction_state s = friction_start(&motion);
   each step: while (friction_leave(&s, &motion)) {}     (at most as often as there are modes)
              f = friction_force(&s, &motion);
              friction_rates(&s, &motion, rate);          (s.memory[i] += dt * rate[i], or better)

   Test: cc -DFRICTION_TEST -o friction_test friction.c -lm && ./friction_test */
#include <math.h>
#define ROUNDING 1e-14 /* of the terms of a quantity: what goes above zero by less does not */

#define FRICTION_MEMORY $memory
enum { $modes };
typedef struct { double x, v, hold, hold_rate, delayed_speed, face_acceleration; } friction_motion;
typedef struct { int mode; unsigned armed; double memory[$size]; } friction_state;

friction_state friction_start(const friction_motion *in)
{
    friction_state s = { in->v < 0 ? $back : in->v > 0 ? $forward : $still, 0u, {0} };
$starts    return s;
}

double friction_force(const friction_state *s, const friction_motion *in)
{
    (void)in;
    switch (s->mode) {
$forces    }
    return 0.0;
}

void friction_rates(const friction_state *s, const friction_motion *in, double *rate)
{
    int i;
    (void)in;
    for (i = 0; i < FRICTION_MEMORY; i++) rate[i] = 0.0;
    switch (s->mode) {
$rates    default: break;
    }
}

/* Whether the mode ends here; then the next one is set, with what it remembers. */
int friction_leave(friction_state *s, const friction_motion *in)
{
    const double force = friction_force(s, in);
    const friction_state before = *s;
    (void)force; (void)before;
    switch (s->mode) {
$exits    default: break;
    }
    return 0;
}

#ifdef FRICTION_TEST
#include <stdio.h>
/* mode, $inputs, memory, friction */
static const double vector[$rows][$columns] = {
$vector
};
int main(void)
{
    int i, j, wrong = 0;
    for (i = 0; i < $rows; i++) {
        const double *r = vector[i];
        friction_motion in = { $motion };
        friction_state s = { (int)r[0], 0u, {0} };
        const double wanted = r[$last];
        for (j = 0; j < FRICTION_MEMORY; j++) s.memory[j] = r[$first + j];
        wrong += !(fabs(friction_force(&s, &in) - wanted) <= 1e-9 * (1e-6 + fabs(wanted)));
    }
    printf("%d of $rows wrong\n", wrong);
    return wrong != 0;
}
#endif
