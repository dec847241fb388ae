/* Steps of the controller from samples of this file, against the same sums written again; of a plan that is a formula,
   against what was computed of it when it was exported. Returns how many numbers differ by more than rounding may make,
   as the certificate allows for it: 0. */
#define CONTROLLER_TABLES
#include "controller.h"
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define TESTS 12
#ifdef PLAN_FORMULA /* is within 2^-24 of the size of the plan; the rows of its table are so many samples apart */
#define DIGITS FLT_EPSILON
#define EVERY 4096
#else
#define EVERY 1
#define DIGITS (sizeof(real) == sizeof(float) ? FLT_EPSILON : DBL_EPSILON)
#endif
#define ROUNDING ((NZ + NX + 3) * DIGITS * 1.01) /* each of both loses half of it at most */
#ifdef PLAN_HANDED
#define GIVEN xs, us,
#else
#define GIVEN
#endif

/* From -6/64 to 6/64: so far no limit acts. */
static real part(int t, int i) { return (real)((7 * t + 5 * i) % 13 - 6) / 64; }

static real xs[NX], us[NU], y[NX], zeta[NZ ? NZ : 1], u[NU];

/* Whether a number differs from first + of_zeta zeta + of_y (y - xs), cut off at low and high. */
static int differs(real found, double first, const float *of_zeta, const float *of_y, double low, double high) {
  double sum = first, size = fabs(low) + fabs(high);
  for (int i = 0; i < NZ; i++) {
    sum += (double)of_zeta[i] * zeta[i];
    size += fabs(of_zeta[i]) * MEMORY[i];
  }
  for (int i = 0; i < NX; i++) {
    sum += of_y[i] * ((double)y[i] - xs[i]);
    size += fabs(of_y[i]) * (fabs(y[i]) + 2 * REACH[i]);
  }
  return !(fabs(found - fmin(fmax(sum, low), high)) <= ROUNDING * size + 1e-37);
}

int main(void) {
  int wrong = 0;
  State s;
  for (int t = 0; t < TESTS; t++) {
    const uint32_t row = (uint32_t)t * (ROWS - 1) / (TESTS - 1);
    controller_start(&s);
    s.k = row * EVERY;
    for (int i = 0; i < NX; i++) {
      xs[i] = XS[row][i];
      y[i] = xs[i] + part(t, i) * REACH[i];
    }
    for (int j = 0; j < NU; j++) us[j] = US[row][j];
    for (int i = 0; i < NZ; i++) s.zeta[i] = zeta[i] = part(t, NX + i) * MEMORY[i];
    wrong += (controller_step(&s, y, GIVEN u) & STATUS_BAD) != 0;
    for (int j = 0; j < NU; j++) wrong += differs(u[j], us[j], M[j], N[j], LOW[j], HIGH[j]);
    for (int i = 0; i < NZ; i++) /* 64: FAR of controller.c */
      wrong += differs(s.zeta[i], 0, F[i], G[i], -64 * MEMORY[i], 64 * MEMORY[i]);
  }
  const State before = s; /* a sample that is not a number changes nothing but the count and the time */
  for (int i = 0; i < NX; i++) y[i] = (real)NAN;
  for (int t = 1; t <= 3; t++) {
    s.k = 0;
    wrong += !(controller_step(&s, y, GIVEN u) & STATUS_BAD) || s.bad != before.bad + (uint32_t)t;
    wrong += memcmp(s.zeta, before.zeta, sizeof s.zeta) != 0 || memcmp(s.delta, before.delta, sizeof s.delta) != 0;
    for (int j = 0; j < NU; j++) wrong += !(u[j] >= LOW[j] && u[j] <= HIGH[j]);
  }
  const State last = s; /* after the end of a plan the command stays */
  s.k = STEPS;
  wrong += controller_step(&s, y, GIVEN u) != STATUS_END || memcmp(u, last.u, sizeof u) != 0;
  printf("%s: %d steps, %d wrong\n", CERTIFICATE, TESTS + 4, wrong);
  return wrong != 0;
}
