/* The controller of a certificate of the sampled loop: C99, no memory of its own, no library but the math of a plan
   that is a formula. Once per sample, and once only: read the sensors, call controller_step, hand u to the actuators
   after the delay of the certificate. Compile without -ffast-math. One State for each of any number of loops. */
#ifndef CONTROLLER_H
#define CONTROLLER_H
#include <stddef.h>
#include <stdint.h>
#include "controller_data.h"

#define STATUS_BAD 1u     /* the sample or the plan is not finite, or they are too far apart: see README.txt */
#define STATUS_END 2u     /* the plan has ended, and what is proven with it: the last command is held */
#define STATUS_CLIPPED 4u /* a limit acted, which it never does while the assumptions of the certificate hold */

#ifdef PLAN_HANDED /* a family of plans: the caller hands in x* now and u* as it is held while this command acts */
#define PLAN_GIVEN const real xs[NX], const real us[NU],
#else
#define PLAN_GIVEN
#endif

typedef struct {
  real zeta[NZ ? NZ : 1]; /* the state of the controller */
  real delta[NU];         /* the last good correction of the plan's input */
  real u[NU];             /* the last command */
  uint32_t k;             /* which sample of the plan is next */
  uint32_t bad;           /* how many samples were bad */
  uint32_t status;        /* of the last sample: STATUS_... or 0 */
} State;

#ifdef __cplusplus
extern "C" {
#endif
void controller_start(State *s); /* before the first sample */
/* y: the states as measured; u: the inputs; returns s->status. */
uint32_t controller_step(State *s, const real y[NX], PLAN_GIVEN real u[NU]);
/* The same for n loops: s[n], y[n][NX], u[n][NU] (and xs[n][NX], us[n][NU]), one after the other in memory. */
void controller_step_many(State *s, size_t n, const real *y, PLAN_GIVEN real *u);
#ifdef __cplusplus
}
#endif
#endif
