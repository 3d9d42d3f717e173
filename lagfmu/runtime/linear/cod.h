/* cod.h -- complete orthogonal decomposition of a dense matrix of any rank. */
#ifndef LAGFMU_COD_H
#define LAGFMU_COD_H

#include <stddef.h>

#include "linkage.h"

/* Pi A P = Q [T^T 0; 0 0] Z^T: Q (rows, rows) and Z (columns, columns) orthogonal, kept as
 * Householder vectors, T (rank, rank) upper triangular, Pi and P permutations. */
typedef struct {
    int rows, columns, rank;
    double *A;           /* (columns * rows), column by column: on entry A, then Q and R */
    double *B;           /* (min(rows, columns) * columns), column by column: Z and T */
    double *tau, *tau_z; /* (columns), (columns): H = 1 - tau v v^T */
    double *work;        /* (rows) */
    int *row, *column;   /* (rows), (columns): which row and column of A comes i-th */
} Cod;

SHARED size_t cod_doubles(int rows, int columns);
SHARED int cod_ints(int rows, int columns);

/* Places the arrays in `doubles` and `ints`; A is then to be filled. */
SHARED void cod_place(Cod *c, int rows, int columns, double *doubles, int *ints);

/* Columns of R whose rest is at most `threshold` times the first count as dependent. */
SHARED void cod_factor(Cod *c, double threshold);

/* y (rows) <- Q^T Pi y ;  y <- Pi^T Q y */
SHARED void cod_to_range(const Cod *c, double *y);
SHARED void cod_from_range(const Cod *c, double *y);

/* w (columns) <- Z^T P^T w ;  w <- P Z w.  `work` of the Cod is not used; `spare` (columns). */
SHARED void cod_to_rows(const Cod *c, double *w, double *spare);
SHARED void cod_from_rows(const Cod *c, double *w, double *spare);

/* z (rank) <- T^-1 z ;  z <- T^-T z */
SHARED void cod_solve(const Cod *c, double *z);
SHARED void cod_solve_transposed(const Cod *c, double *z);

#endif
