/* linear.h -- accelerations and multipliers:  M x = b + G^T lambda ,  G x = c  on the rows that act.
 *
 * Factor once, solve as often as needed.  Sign: +G^T lambda stands on the side of the forces.
 * The ladder (linear.c) takes the first rung that is safe at this state:
 *   1. schur.c       sparse Cholesky of the Schur complement, guarded by its condition estimate; where M
 *                    is singular, with constraints that hold it (stiffened.c)
 *   2. kkt.c         LU of the scaled KKT matrix, with refinement
 *   3. orthogonal.c  complete orthogonal decomposition weighted by M: dependent rows (dependent.h); by the first
 *                    where rows are known that stand for all (kept.c) */
#ifndef LAGFMU_LINEAR_H
#define LAGFMU_LINEAR_H

#include "arena.h"
#include "linkage.h"
#include "status.h"
#include "system.h"

typedef enum {
    RUNG_SCHUR, RUNG_KKT, RUNG_ORTHOGONAL, RUNG_LEAST_NORM, RUNG_NULLSPACE,
    RUNG_KEPT,       /* dependent rows, by those that stand for all */
    RUNG_SQUARE,     /* as many rows as speeds: square.c */
    RUNG_WRITTEN_OUT /* the first, as system->solve */
} Rung;

/* Of refinement.c: the low parts of x (nv) and lambda (m); what both equations leave, r (nv), with its low part,
 * and g (m); the corrections. */
typedef struct {
    double *x_low, *lambda_low, *r, *r_low, *g, *dx, *dlambda;
} Refinement;

typedef struct {
    const System *system;
    const double *M, *G;  /* the values that were factored (not copied: they must stay) */
    const int *active;    /* (m) 1 where a row acts (not copied) */
    const int *some;      /* the same; NULL where all act */
    Rung rung;
    int *unique;          /* (m) 1 where lambda is determined uniquely; 1 for rows that do not act */
    Why *why;
    double *zero;         /* (nv) for b = NULL */
    double *sparse;       /* workspace of schur.c */
    Refinement refinement;
    double *dense;        /* workspace of the dense rungs; NULL beyond DENSE_MOST */
    int *pivots;
    int stiffened;        /* 1: M holds more than masses (stiffened.h) */
    const double *bare;   /* then: M as it was given */
    double *masses, *forces, *sigma; /* (masses), (nv), (m) of stiffened.c */
    int *holds;           /* (m) */
    struct SquareMemory *square; /* of square.c; NULL without system->square */
    double off;           /* how far off the constraints the state is, relative to their size; 0: on them */
    int nearest;          /* 1 within linear_nearest() and linear_project() */
} Linear;

enum { DENSE_MOST = 600 }; /* n + m up to which the dense rungs are there */

/* Takes the workspace for `s` from the arena. */
SHARED void linear_layout(Linear *l, Arena *arena, const System *s, Why *why);

/* Factors for the rows in `active`.  FAILED, with the cause in `why`: a value is not finite, or the
 * mass matrix is singular on the constraint surface. */
SHARED Status linear_factor(Linear *l, const double *M, const double *G, const int *active);

/* The same, where rows are known to depend on each other and `basis` (m; NULL: not known) to stand for all: what the
 * decomposition of all would find, for a fraction of its cost. */
SHARED Status linear_factor_kept(Linear *l, const double *M, const double *G, const int *active, const int *basis);

/* x (nv) and lambda (m; 0 where a row does not act).  c is read where rows act; b may be NULL (zero).
 * lambda may be NULL.  FAILED: dependent rows contradict each other, or the result overflows. */
SHARED Status linear_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* The same for a projection (b = NULL: x of least size in the metric of M) or an impact: where dependent rows
 * contradict each other, as those of c do that is nothing but rounding, c is met as nearly as can be (least
 * squares in rows of comparable units). */
SHARED Status linear_nearest(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* Factors and does that at once; a coordinate that has neither mass nor a constraint stays. */
SHARED Status linear_project(Linear *l, const double *M, const double *G, const int *active,
                             const double *c, double *x);

/* How far rows of unit norm have to stand out to count as independent: rows that depend on each other on
 * the constraints are at angles of the order of `off` away from them. */
SHARED double linear_rank_threshold(const Linear *l);

/* How far the rows that were factored last are from depending on each other: the least sine of the angle between
 * a row and those eliminated before it, in the metric of M; 1 where nothing has asked for it. */
SHARED double linear_apart(const Linear *l);

/* The same of rows that do depend on each other, for as many as are independent, those taken that are furthest apart. */
SHARED double linear_furthest_apart(const Linear *l);

/* 1 if the first rung was safe. */
SHARED int linear_plain(const Linear *l);

/* 1 if the rows that were factored last depend on each other.  basis (m): then as many of them as are
 * independent, otherwise all.  Factors are lost. */
SHARED int linear_basis(Linear *l, int *basis);

/* FAILED: rows that depend on each other ask for different accelerations; the cause names them. */
SHARED Status linear_contradicted(Linear *l);

#endif
