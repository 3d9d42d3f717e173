/* lu.h -- dense LU with partial pivoting, row by row in memory. */
#ifndef LAGFMU_LU_H
#define LAGFMU_LU_H

#include "linkage.h"

/* A (n * n) = P L U in place; 0, or 1 + the column in which no pivot other than zero was found. */
SHARED int lu_factor(int n, double *A, int *pivots);

/* b <- A^-1 b for the factors above. */
SHARED void lu_solve(int n, const double *A, const int *pivots, double *b);

/* The same for complex matrices, real and imaginary parts apart. */
SHARED int lu_factor_complex(int n, double *A_re, double *A_im, int *pivots);
SHARED void lu_solve_complex(int n, const double *A_re, const double *A_im, const int *pivots,
                             double *b_re, double *b_im);

#endif
