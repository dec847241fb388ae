/* tubecert export, certificate any, text sha256:5ddfa2d01f49c1103c0720449ee3fd7e388fb33d3c41e77f48d51b3cacb2f822 */
/* Steps of the controller against exact ones, computed from the same tables when they were exported. Returns how many
   differ by more than rounding may make, as the certificate allows for it: 0. */
#define CONTROLLER_TABLES
#define CONTROLLER_SELFTEST
#include "controller.h"
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#ifdef PLAN_FORMULA /* is within 2^-24 of the size of the plan */
#define DIGITS FLT_EPSILON
#else
#define DIGITS (sizeof(real) == sizeof(float) ? FLT_EPSILON : DBL_EPSILON)
#endif
#define ROUNDING ((NZ + NX + 3) * DIGITS / 2 * 1.01)
#ifdef PLAN_HANDED
#define GIVEN(t) TEST_XS[t], TEST_US[t],
#else
#define GIVEN(t)
#endif

/* Whether two numbers differ by more than the rounding of a sum whose terms are of these sizes. */
static int differ(real found, double exact, double size) {
  return !(fabs(found - exact) <= ROUNDING * size + 1e-37);
}

static double size(const float *of_zeta, const float *of_y, const real *y) {
  double sum = 0;
  for (int i = 0; i < NZ; i++) sum += fabs(of_zeta[i]) * MEMORY[i];
  for (int i = 0; i < NX; i++) sum += fabs(of_y[i]) * (fabs(y[i]) + 2 * REACH[i]);
  return sum;
}

int main(void) {
  int wrong = 0;
  State s;
  real u[NU];
  for (int t = 0; t < TESTS; t++) {
    controller_start(&s);
    s.k = TEST_K[t];
    memcpy(s.zeta, TEST_ZETA[t], sizeof s.zeta);
    wrong += (controller_step(&s, TEST_Y[t], GIVEN(t) u) & STATUS_BAD) != 0;
    for (int j = 0; j < NU; j++)
      wrong += differ(u[j], TEST_U[t][j], fabs(LOW[j]) + fabs(HIGH[j]) + size(M[j], N[j], TEST_Y[t]));
    for (int i = 0; i < NZ; i++) wrong += differ(s.zeta[i], TEST_NEXT[t][i], size(F[i], G[i], TEST_Y[t]));
  }
  const State before = s; /* a sample that is not a number changes nothing but the count and the time */
  real y[NX];
  for (int i = 0; i < NX; i++) y[i] = (real)NAN;
  for (int t = 1; t <= 3; t++) {
    s.k = 0;
    wrong += !(controller_step(&s, y, GIVEN(0) u) & STATUS_BAD) || s.bad != before.bad + (uint32_t)t;
    wrong += memcmp(s.zeta, before.zeta, sizeof s.zeta) != 0 || memcmp(s.delta, before.delta, sizeof s.delta) != 0;
    for (int j = 0; j < NU; j++) wrong += !(u[j] >= LOW[j] && u[j] <= HIGH[j]);
  }
  printf("%s: %d steps, %d wrong\n", CERTIFICATE, TESTS + 3, wrong);
  return wrong != 0;
}
