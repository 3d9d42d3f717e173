/* ldlt.c -- sparse A = L D L^T, row by row (Davis, Direct Methods for Sparse Linear Systems, sect.
 * 4.7; Golub & Van Loan, Matrix Computations, sect. 4.1.2), with a bound of the condition number
 * that costs next to nothing.
 *
 * C = R^-1 A R^-1 with R_i = sqrt(A_ii) has a unit diagonal.  Its norm is at most the number w of
 * non-zeros in a row, because |C_ij| <= 1; and the norm of its inverse is at most
 *
 *   trace C^-1 = sum_i s_i / D_i ,    s_i = || row i of L^-1 R ||^2
 *
 * Row i of L^-1 is e_i minus the rows j that L_ij brings in, at most k_i of which overlap in a
 * column:
 *
 *   s_i <= A_ii + k_i sum_j L_ij^2 s_j
 *
 * with equality where they do not overlap, as in a chain.  So w trace C^-1 is never below the
 * condition number; for a hanging chain of m equal links it is 3 m^2, where the condition number is
 * 1.6 m^2.  Where rows overlap all the way, as in a chain of bodies in space, it grows by a factor with each.
 *
 * There the trace itself is asked for: A^-1 = d log det A / dA, so that of log det A = sum log D_p, by the
 * operations of the factorization in reverse (Griewank & Walther, Evaluating Derivatives, sect. 3.2), come its
 * elements in the pattern of L, its diagonal among them. */
#include "ldlt.h"

#include <math.h>
#include <stddef.h>

/* Row p of L where none of the rows that enter it meet: L_pi = A_pi / D_i. */
static double forest_row(const Elimination *e, double *L, const double *D, const double *row_size,
                         int p, double *pivot) {
    double size = *pivot, rest = *pivot;
    for (int k = e->start[p]; k < e->start[p + 1]; k++) {
        int i = e->column[k];
        double a = L[k], l = a * D[i];
        L[k] = l;
        rest -= a * l;
        size += l * l * row_size[i];
    }
    *pivot = rest;
    return size;
}

/* Row p of L by L y = a, a being row p of A: L_pi = y_i / D_i. */
static double general_row(const Elimination *e, double *L, const double *D, const double *row_size,
                          double *row, int p, double *pivot) {
    double sum = 0, size = *pivot, rest = *pivot;
    for (int k = e->start[p]; k < e->start[p + 1]; k++) {
        int i = e->column[k];
        double y = L[k];
        for (int r = e->start[i]; r < e->start[i + 1]; r++) y -= L[r] * row[e->column[r]];
        row[i] = y;
        double l = y * D[i];
        L[k] = l;
        rest -= y * l;
        sum += l * l * row_size[i];
    }
    for (int k = e->start[p]; k < e->start[p + 1]; k++) row[e->column[k]] = 0;
    *pivot = rest;
    return size + e->overlap[p] * sum;
}

Definite ldlt_factor(const Elimination *e, double *L, double *D, double *row_size, double *row, const int *acts) {
    Definite found = {HUGE_VAL, 1, -1};
    double trace = 0;
    for (int p = 0; p < e->size; p++) {
        double diagonal = D[p], pivot = diagonal;
        if (acts != NULL && !acts[e->order[p]]) {
            row_size[p] = 1;
            trace += 1;
            continue;
        }
        double size = e->forest ? forest_row(e, L, D, row_size, p, &pivot)
                                : general_row(e, L, D, row_size, row, p, &pivot);
        if (!(pivot > 0 && pivot < HUGE_VAL)) {
            found.failed = p;
            return found;
        }
        double inverse = 1 / pivot;
        D[p] = inverse;
        row_size[p] = size;
        trace += size * inverse;
        if (diagonal * inverse > found.growth) found.growth = diagonal * inverse;
    }
    if (trace < HUGE_VAL) found.bound = e->widest * trace;
    return found;
}

double ldlt_trace(const Elimination *e, const double *L, const double *D, const double *diagonal, const int *acts,
                  const Reverse *x) {
    double trace = 0;
    for (int p = 0; p < e->size; p++) x->by_D[p] = D[p];
    for (int k = 0; k < e->start[e->size]; k++) x->by_L[k] = 0;
    for (int p = e->size - 1; p >= 0; p--) {
        const int from = e->start[p], to = e->start[p + 1];
        const double own = x->by_D[p]; /* of A^-1 */
        trace += diagonal[e->order[p]] * own;
        if (acts != NULL && !acts[e->order[p]]) continue;
        for (int k = from; k < to; k++) { /* L_pi = y_i / D_i, D_p = A_pp - sum_i y_i^2 / D_i */
            const int i = e->column[k];
            const double by_L = x->by_L[k] * D[i];
            x->y[i] = L[k] / D[i];
            x->by_y[i] = by_L - 2 * L[k] * own;
            x->by_D[i] += L[k] * (L[k] * own - by_L);
        }
        for (int k = to - 1; k >= from; k--) { /* y_i = A_pi - sum_r L_ir y_r */
            const int i = e->column[k];
            const double by_y = x->by_y[i];
            for (int r = e->start[i]; r < e->start[i + 1]; r++) {
                x->by_y[e->column[r]] -= L[r] * by_y;
                x->by_L[r] -= x->y[e->column[r]] * by_y;
            }
        }
        for (int k = from; k < to; k++) x->y[e->column[k]] = 0;
    }
    return trace;
}

void ldlt_forward(const Elimination *e, const double *L, double *y) {
    for (int p = 0; p < e->size; p++) {
        double sum = y[p];
        for (int k = e->start[p]; k < e->start[p + 1]; k++) sum -= L[k] * y[e->column[k]];
        y[p] = sum;
    }
}

void ldlt_backward(const Elimination *e, const double *L, double *y) {
    for (int p = e->size - 1; p >= 0; p--)
        for (int k = e->start[p]; k < e->start[p + 1]; k++) y[e->column[k]] -= L[k] * y[p];
}
