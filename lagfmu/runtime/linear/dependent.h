/* dependent.h -- the rungs of linear.c that only constraints need: rows of G that depend on each other
 * (kept.c, orthogonal.c; leastnorm.c where a coordinate has no mass), and the null space of G. */
#ifndef LAGFMU_DEPENDENT_H
#define LAGFMU_DEPENDENT_H

#include "linear.h"
#include "linkage.h"

typedef struct {
    /* Doubles and ints that they need in Linear.dense and Linear.pivots. */
    size_t (*doubles)(int n, int m);
    size_t (*ints)(int n, int m);
    /* kept.c: by rows `basis` (m) that stand for all that act, if they surely do; then l->unique says where lambda is
     * not.  0 if solving shows that they do not. */
    int (*keep)(Linear *l, const int *basis);
    int (*solve_kept)(Linear *l, const double *b, const double *c, double *x, double *lambda);
    /* lambda eliminated, if that is safe at this state. */
    int (*nullspace)(Linear *l);
    /* orthogonal.c, or leastnorm.c where M is singular; FAILED: so it is on the constraint surface. */
    Status (*factor)(Linear *l);
    /* By the rung that was factored.  FAILED: the constraints contradict each other. */
    Status (*solve)(Linear *l, const double *b, const double *c, double *x, double *lambda);
    /* See linear_basis(); of the rung that was factored, whose factors are lost. */
    int (*basis)(Linear *l, int *basis);
    /* See linear_furthest_apart(); of orthogonal.c. */
    double (*apart)(const Linear *l);
} Dependent;

/* orthogonal.c: 1 if M is safely positive definite; clears l->unique where lambda is not.  `doubtful`: rows that
 * seem to depend on each other may do so only because a coordinate is so heavy that it hides in the metric of
 * M.  FAILED: the constraints contradict each other. */
SHARED int orthogonal_factor(Linear *l, int *doubtful);
SHARED Status orthogonal_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* leastnorm.c: its doubles and ints for n speeds and m rows; clears l->unique likewise.  FAILED: the mass matrix is
 * singular on the constraint surface; the constraints contradict each other. */
SHARED size_t least_norm_doubles(int n, int m);
SHARED int least_norm_ints(int n, int m);
SHARED Status least_norm_factor(Linear *l);
SHARED Status least_norm_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* kept.c: see Dependent; the basis of the factors. */
SHARED int kept_factor(Linear *l, const int *basis);
SHARED int kept_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);
SHARED int kept_basis(const Linear *l, int *basis);

/* NULL in an FMU without constraints: its optional.c says so, and dependent.c is not there. */
SHARED const Dependent *const DEPENDENT;

#endif
