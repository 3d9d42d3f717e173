/* schur.h -- lambda from the Schur complement S = G M^-1 G^T, sparse, in the order of the plan. */
#ifndef LAGFMU_SCHUR_H
#define LAGFMU_SCHUR_H

#include "ldlt.h"
#include "linear.h"
#include "linkage.h"

/* How far the factors can be trusted. */
typedef enum {
    SCHUR_EXACT,   /* as they are */
    SCHUR_REFINED, /* with refinement */
    SCHUR_DOUBLED, /* with refinement by residuals in doubled precision */
    SCHUR_UNSAFE
} Trust;

/* Lives at the head of Linear.sparse.  Positions count in the order of elimination. */
typedef struct {
    double *mass_lower;        /* M = L D L^T: L, empty if M is diagonal */
    double *inverse_mass;      /* (nv) 1 / D */
    const int *w_start, *w_column;
    const double *w;           /* W = L^-1 P G^T by rows of G; if M is diagonal that is G itself */
    double *w_own;             /* the same where M is not diagonal */
    double *h;                 /* D^-1 W of rows that act */
    int *mass_begin, *begin;   /* of L and L': see ldlt_begins() */
    double *lower, *inverse;   /* S = L' D' L'^T: L' and 1 / D' (m) */
    double *diagonal;          /* (m) S_kk by rows of G; 1 where a row does not act */
    Bounds bounds;             /* (max(nv, m)) scratch of ldlt.c */
    double *reverse;           /* scratch of ldlt_trace() in the pattern of L' */
    double *y, *z;             /* (nv), (m) scratch of schur_solve() */
    double *lambda;            /* (m) where the caller asks for none */
    double condition, growth;  /* of M and S, the worse of the two (ldlt.h) */
    double apart;              /* sine of the least angle between a row and those before it */
    Trust trust;
    int definite;              /* 1: M is safely so */
    int doubtful_mass;         /* coordinate whose pivot in M vanishes, or -1 */
    int doubtful_row;          /* row of G whose pivot in S vanishes, or -1 */
} Schur;

static inline Schur *schur_of(const Linear *l) { return (Schur *)(void *)l->sparse; }

SHARED void schur_layout(Linear *l, Arena *arena);

/* M = L D L^T, W, D^-1 W and the diagonal of S.  1; 0 if M is not safely positive definite or a row
 * of G that acts is zero (`zero_rows`: allowed). */
SHARED int schur_masses(Linear *l, int zero_rows);

/* The same and S = L' D' L'^T, judged.  1 if it can be trusted. */
SHARED int schur_factor(Linear *l);

/* y (nv) in the order of elimination: D^-1 L^-1 P b, and back: x = P^T L^-T y. */
SHARED void schur_half(const Linear *l, const double *b, double *y);
SHARED void schur_back(const Linear *l, double *y, double *x);

/* y (nv) <- D^-1 L^-1 P g_k^T of a row that acts; then that less what the rows of l->some make of it, in the metric of M:
 * lambda (m; 0 elsewhere) is what has to be added of each. */
SHARED void schur_begin_row(const Linear *l, int k, double *y);
SHARED void schur_express(Linear *l, double *y, double *lambda);

/* x and lambda (not NULL), refined as the trust asks for.  0 if the refinement does not settle. */
SHARED int schur_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

#endif
