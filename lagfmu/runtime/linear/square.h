/* square.h -- as many rows as speeds, all of which act:  G x = c  and  G^T lambda = M x - b  by the blocks of G.
 *
 * Rows and columns are ordered when the FMU is built (codegen/c/blocks.py), so that G is lower triangular in blocks. */
#ifndef LAGFMU_SQUARE_H
#define LAGFMU_SQUARE_H

#include "arena.h"
#include "linear.h"
#include "linkage.h"

typedef struct Square {
    void (*layout)(Linear *l, Arena *arena);
    int (*factor)(Linear *l);
    void (*solve)(Linear *l, const double *b, const double *c, double *x, double *lambda);
    int (*sign)(Linear *l);
    int count, small;          /* small: 1 if the blocks cost less than the elimination by the plan */
    const int *start;          /* (count + 1) where each block begins in: */
    const int *rows, *columns; /* (nv) those of the blocks, one block behind the other */
} Square;

/* What system->square points to, with the members above from here. */
SHARED void square_layout(Linear *l, Arena *arena);

/* 0 where no block can be trusted to be regular: then others tell. */
SHARED int square_factor(Linear *l);

/* b NULL: zero; lambda NULL: not asked for. */
SHARED void square_solve(Linear *l, const double *b, const double *c, double *x, double *lambda);

/* Of the determinant of the l->G that were factored last, by this or by another rung; it changes where branches of the
 * motion cross.  0: it is 0. */
SHARED int square_sign(Linear *l);

#endif
