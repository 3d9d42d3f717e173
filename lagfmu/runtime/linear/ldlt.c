/* ldlt.c -- sparse A = L D L^T, row by row (Davis, Direct Methods for Sparse Linear Systems, sect.
 * 4.7; Golub & Van Loan, Matrix Computations, sect. 4.1.2), with a bound of the condition number
 * that costs next to nothing.
 *
 * C = R^-1 A R^-1 with R_i = sqrt(A_ii) has a unit diagonal.  Its norm is at most the number w of
 * non-zeros in a row, because |C_ij| <= 1, and at most the largest sum_j |C_ij| (Gershgorin); and the norm of
 * its inverse is at most
 *
 *   trace C^-1 = sum_i s_i / D_i ,    s_i = || row i of L^-1 R ||^2
 *
 * Row i of L^-1 is e_i minus the rows j that L_ij brings in, at most k_i of which overlap in a
 * column:
 *
 *   s_i <= A_ii + min(k_i sum_j L_ij^2 s_j , (sum_j |L_ij| sqrt s_j)^2)
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

#include "numbers.h"

/* Row p of L where none of the rows that enter it meet: L_pi = A_pi / D_i.  Its pivot and s_p. */
static double forest_row(const Elimination *e, double *L, const double *D, int p, const Bounds *own, double *pivot) {
    double size = *pivot, rest = *pivot;
    for (int k = e->start[p]; k < e->start[p + 1]; k++) {
        int i = e->column[k];
        double a = L[k], l = a * D[i];
        L[k] = l;
        rest -= a * l;
        size += l * l * own->size[i];
    }
    *pivot = rest;
    return own->size[p] = size;
}

/* Row p of L by L y = a, a being row p of A: L_pi = y_i / D_i. */
static double general_row(const Elimination *e, const int *begin, double *L, const double *D, int p, const Bounds *own,
                          double *pivot) {
    const double scale = 1 / sqrt(*pivot);
    double squares = 0, sum = 0, norm = 0, rest = *pivot, size = *pivot;
    double *row = own->row;
    const int *column = e->column, from = e->start[p], to = e->start[p + 1];
    for (int k = from; k < to; k++) {
        const int i = column[k];
        const double c = fabs(L[k]) * own->scale[i]; /* C_pi = A_pi / (R_p R_i) */
        double y = L[k];
        for (int r = begin[k], end = e->start[i + 1]; r < end; r++) y -= L[r] * row[column[r]];
        row[i] = y;
        const double l = y * D[i];
        L[k] = l;
        rest -= y * l;
        const double part = fabs(l) * own->size[i];
        squares += part * part;
        sum += part;
        norm += c;
        own->norm[i] += c * scale;
    }
    for (int k = from; k < to; k++) row[column[k]] = 0;
    own->scale[p] = scale;
    own->norm[p] = 1 + norm * scale;
    *pivot = rest;
    size += smaller(e->overlap[p] * squares, sum * sum);
    own->size[p] = sqrt(size);
    return size;
}

/* Of || C ||. */
static double norm_bound(const Elimination *e, const Bounds *own) {
    double norm = e->forest ? e->widest : 0;
    for (int p = 0; p < e->size && !e->forest; p++) norm = larger(norm, own->norm[p]);
    return smaller(norm, e->widest);
}

void ldlt_begins(const Elimination *e, int *begin) {
    for (int p = 0; p < e->size; p++)
        for (int k = e->start[p]; k < e->start[p + 1]; k++) {
            const int i = e->column[k], first = e->column[e->start[p]];
            begin[k] = e->start[i];
            while (begin[k] < e->start[i + 1] && e->column[begin[k]] < first) begin[k]++;
        }
}

Definite ldlt_factor(const Elimination *e, const int *begin, double *L, double *D, const Bounds *own, const int *acts) {
    Definite found = {HUGE_VAL, HUGE_VAL, 1, -1};
    double trace = 0;
    for (int p = 0; p < e->size; p++) {
        double diagonal = D[p], pivot = diagonal;
        if (acts != NULL && !acts[e->order[p]]) {
            own->size[p] = own->scale[p] = own->norm[p] = 1;
            trace += 1;
            continue;
        }
        double size =
            e->forest ? forest_row(e, L, D, p, own, &pivot) : general_row(e, begin, L, D, p, own, &pivot);
        if (!(pivot > 0 && pivot < HUGE_VAL)) {
            found.failed = p;
            return found;
        }
        double inverse = 1 / pivot;
        D[p] = inverse;
        trace += size * inverse;
        if (diagonal * inverse > found.growth) found.growth = diagonal * inverse;
    }
    found.norm = norm_bound(e, own);
    if (trace < HUGE_VAL) found.bound = found.norm * trace;
    return found;
}

double ldlt_trace(const Elimination *e, const int *begin, const double *L, const double *D, const double *diagonal,
                  const int *acts, const Reverse *x) {
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
            x->l[i] = L[k];
            x->by_y[i] = x->by_L[k] - 2 * L[k] * own;
            x->by_D[i] += L[k] * (L[k] * own - x->by_L[k]);
        }
        for (int k = to - 1; k >= from; k--) { /* y_i = A_pi - sum_r L_ir y_r */
            const int i = e->column[k];
            const double by_y = x->by_y[i];
            for (int r = begin[k]; r < e->start[i + 1]; r++) {
                x->by_y[e->column[r]] -= L[r] * by_y;
                x->by_L[r] -= x->l[e->column[r]] * by_y;
            }
        }
        for (int k = from; k < to; k++) x->l[e->column[k]] = 0;
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
