/* equations.h -- the index-1 equations and the projection as the peers take them, from the
 * generated right-hand side:
 *
 *   M vdot = F + G^T lambda ,  G vdot = gamma ;     M dq = G^T mu ,  G dq = -f
 *
 * Two files fill it: equations_dense.c (a dense Cholesky of the Schur complement, what one writes
 * by hand) and equations_runtime.c (linear.c of our own runtime, what our solver runs on).  The
 * peers are measured with the faster of the two. */
#ifndef EQUATIONS_H
#define EQUATIONS_H

#include "system.h"

typedef struct {
    const System *s;
    const double *p;
    double *M, *F, *G, *nu, *gamma; /* at the state that was evaluated last */
    long evaluations;
    void *factors;
} Equations;

/* 0 on success, like every int here. */
int equations_create(Equations *e, const System *s, const double *p);
void equations_destroy(Equations *e);

void equations_evaluate(Equations *e, double t, const double *q, const double *v);
int equations_factor(Equations *e);

/* x (n), lambda (m) of  M x = b + G^T lambda ,  G x = c ; b NULL: zero. */
int equations_solve(Equations *e, const double *b, const double *c, double *x, double *lambda);

int equations_motion(Equations *e, double t, const double *q, const double *v, double *vdot,
                     double *lambda);

/* y_k += sign * sum_j G_kj x_j, and y_j += sign * sum_k G_kj x_k. */
void rows_times(const System *s, const double *G, double sign, const double *x, double *y);
void columns_times(const System *s, const double *G, double sign, const double *x, double *y);

/* y_i += sign * sum_j M_ij x_j, from M's lower triangle. */
void mass_times(const System *s, const double *M, double sign, const double *x, double *y);

#endif
