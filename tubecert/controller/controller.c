/* delta = M zeta + N dy, u = us + delta, zeta' = F zeta + G dy, with dy = y - xs. Every order of these sums, with fused
   multiply-adds or without, loses at most gamma(NZ + NX + 3) of the sum of their sizes, which is proven for. */
#define CONTROLLER_TABLES
#include "controller.h"
#if defined(__FAST_MATH__) || defined(_M_FP_FAST) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "compile without -ffast-math: it removes the test for what is not a number"
#endif

#define FAR 64 /* times what is proven: samples and zeta are cut off there, so that they stay finite, and no nearer: a
                  loop that was disturbed by more than its certificate allows for has to find its way back */

static real clip(real v, real low, real high) { return v >= low ? (v <= high ? v : high) : low; }

static int finite_number(real v) { return v - v == 0; }

void controller_start(State *s) { *s = (State){.k = 0}; }

#ifdef PLAN_TABLE
static void plan(uint32_t row, real xs[NX], real us[NU]) {
  for (int i = 0; i < NX; i++) xs[i] = XS[row][i];
  for (int j = 0; j < NU; j++) us[j] = US[row][j];
}
#endif

uint32_t controller_step(State *s, const real y[NX], PLAN_GIVEN real u[NU]) {
  real dy[NX], zeta[NZ ? NZ : 1];
  int used = 1;
  if (s->k >= STEPS) {
    for (int j = 0; j < NU; j++) u[j] = s->u[j];
    return s->status = STATUS_END;
  }
#ifndef PLAN_HANDED
  real xs[NX], us[NU];
  plan(s->k, xs, us);
#endif
  for (int j = 0; j < NU; j++) used = used && finite_number(us[j]); /* what is handed in may be missing */
  uint32_t status = used ? 0 : STATUS_BAD;
  for (int i = 0; i < NX; i++) {
    dy[i] = y[i] - xs[i];
    if (dy[i] >= -REACH[i] && dy[i] <= REACH[i]) continue;
    status = STATUS_BAD;
    if ((s->status & STATUS_BAD) && finite_number(dy[i])) /* not the first: no glitch, so it is steered against */
      dy[i] = clip(dy[i], -FAR * REACH[i], FAR * REACH[i]);
    else
      used = 0;
  }
  for (int j = 0; j < NU; j++) { /* the inputs first: what comes after them delays nothing */
    if (used) {
      real sum = 0;
      for (int i = 0; i < NZ; i++) sum += M[j][i] * s->zeta[i];
      for (int i = 0; i < NX; i++) sum += N[j][i] * dy[i];
      s->delta[j] = sum;
    }
    const real wanted = finite_number(us[j]) ? us[j] + s->delta[j] : s->u[j];
    u[j] = s->u[j] = clip(wanted, LOW[j], HIGH[j]);
    if (u[j] != wanted) status |= STATUS_CLIPPED;
  }
  if (used) {
    for (int i = 0; i < NZ; i++) {
      real sum = 0;
      for (int j = 0; j < NZ; j++) sum += F[i][j] * s->zeta[j];
      for (int j = 0; j < NX; j++) sum += G[i][j] * dy[j];
      zeta[i] = clip(sum, -FAR * MEMORY[i], FAR * MEMORY[i]);
    }
    for (int i = 0; i < NZ; i++) s->zeta[i] = zeta[i];
  }
  if (status & STATUS_BAD) s->bad++;
  s->k = s->k + 1 < STEPS ? s->k + 1 : AFTER;
  return s->status = status;
}

void controller_step_many(State *s, size_t n, const real *y, PLAN_GIVEN real *u) {
  for (size_t i = 0; i < n; i++)
#ifdef PLAN_HANDED
    controller_step(s + i, y + i * NX, xs + i * NX, us + i * NU, u + i * NU);
#else
    controller_step(s + i, y + i * NX, u + i * NU);
#endif
}
