/* cod.c -- complete orthogonal decomposition (Golub & Van Loan, Matrix Computations, sect. 5.4): QR
 * with column pivoting, A P = Q [R11 R12], then [R11 R12]^T = Z [T; 0].
 *
 * The rows are sorted by size first: with that, Householder's QR with column pivoting is stable row
 * by row, however different their sizes are (Cox & Higham, BIT 38 (1998) 34).  The last columns of
 * P Z span the null space of A, the last of Pi^T Q that of A^T. */
#include "cod.h"

#include <math.h>

static int fewer(int a, int b) { return a < b ? a : b; }

size_t cod_doubles(int rows, int columns) {
    size_t r = (size_t)rows, c = (size_t)columns;
    return r * c + (size_t)fewer(rows, columns) * c + 2 * c + r;
}

int cod_ints(int rows, int columns) { return rows + columns; }

void cod_place(Cod *c, int rows, int columns, double *doubles, int *ints) {
    c->rows = rows;
    c->columns = columns;
    c->rank = 0;
    c->tau = doubles;
    c->tau_z = c->tau + columns;
    c->work = c->tau_z + columns;
    c->A = c->work + rows;
    c->B = c->A + rows * columns;
    c->row = ints;
    c->column = ints + rows;
}

/* The largest element of v (n) without overflow or underflow in the squares, and || v ||. */
static double euclidean_norm(int n, const double *v) {
    double largest = 0, sum = 0;
    for (int i = 0; i < n; i++) largest = fmax(largest, fabs(v[i]));
    if (!(largest > 0)) return 0;
    for (int i = 0; i < n; i++) sum += v[i] / largest * (v[i] / largest);
    return largest * sqrt(sum);
}

/* v (n) <- [alpha; the Householder vector's rest], its first element being 1; returns tau. */
static double reflector(int n, double *v) {
    double size = euclidean_norm(n, v);
    if (!(size > 0)) return 0;
    double alpha = v[0] > 0 ? -size : size;
    double head = v[0] - alpha;
    for (int i = 1; i < n; i++) v[i] /= head;
    v[0] = alpha;
    return -head / alpha;
}

/* y (n) <- (1 - tau v v^T) y */
static void reflect(int n, const double *v, double tau, double *y) {
    double sum = y[0];
    for (int i = 1; i < n; i++) sum += v[i] * y[i];
    sum *= tau;
    y[0] -= sum;
    for (int i = 1; i < n; i++) y[i] -= sum * v[i];
}

/* Rows by descending largest element. */
static void sort_rows(Cod *c) {
    double *size = c->work;
    for (int i = 0; i < c->rows; i++) {
        double largest = 0;
        for (int j = 0; j < c->columns; j++) largest = fmax(largest, fabs(c->A[j * c->rows + i]));
        int at = i;
        for (; at > 0 && size[at - 1] < largest; at--) {
            size[at] = size[at - 1];
            c->row[at] = c->row[at - 1];
        }
        size[at] = largest;
        c->row[at] = i;
    }
    for (int j = 0; j < c->columns; j++) {
        double *column = c->A + j * c->rows;
        for (int i = 0; i < c->rows; i++) c->work[i] = column[c->row[i]];
        for (int i = 0; i < c->rows; i++) column[i] = c->work[i];
    }
}

static void exchange_columns(Cod *c, int j, int k) {
    for (int i = 0; i < c->rows; i++) {
        double swapped = c->A[j * c->rows + i];
        c->A[j * c->rows + i] = c->A[k * c->rows + i];
        c->A[k * c->rows + i] = swapped;
    }
    int swapped = c->column[j];
    c->column[j] = c->column[k];
    c->column[k] = swapped;
}

/* Q, R and the rank. */
static void triangularize(Cod *c, double threshold) {
    double first = 0;
    for (int j = 0; j < c->columns; j++) c->column[j] = j;
    for (c->rank = 0; c->rank < fewer(c->rows, c->columns); c->rank++) {
        int k = c->rank, best = k;
        double largest = -1;
        for (int j = k; j < c->columns; j++) {
            double rest = euclidean_norm(c->rows - k, c->A + j * c->rows + k);
            if (rest > largest) {
                largest = rest;
                best = j;
            }
        }
        if (k == 0) first = largest;
        if (!(largest > threshold * first)) break;
        if (best != k) exchange_columns(c, k, best);
        double *v = c->A + k * c->rows + k;
        c->tau[k] = reflector(c->rows - k, v);
        for (int j = k + 1; j < c->columns; j++)
            reflect(c->rows - k, v, c->tau[k], c->A + j * c->rows + k);
    }
}

void cod_factor(Cod *c, double threshold) {
    sort_rows(c);
    triangularize(c, threshold);
    for (int i = 0; i < c->rank; i++) /* [R11 R12]^T */
        for (int j = 0; j < c->columns; j++)
            c->B[i * c->columns + j] = j < i ? 0 : c->A[j * c->rows + i];
    for (int k = 0; k < c->rank; k++) {
        double *v = c->B + k * c->columns + k;
        c->tau_z[k] = reflector(c->columns - k, v);
        for (int j = k + 1; j < c->rank; j++)
            reflect(c->columns - k, v, c->tau_z[k], c->B + j * c->columns + k);
    }
}

void cod_to_range(const Cod *c, double *y) {
    for (int i = 0; i < c->rows; i++) c->work[i] = y[c->row[i]];
    for (int i = 0; i < c->rows; i++) y[i] = c->work[i];
    for (int k = 0; k < c->rank; k++)
        reflect(c->rows - k, c->A + k * c->rows + k, c->tau[k], y + k);
}

void cod_from_range(const Cod *c, double *y) {
    for (int k = c->rank - 1; k >= 0; k--)
        reflect(c->rows - k, c->A + k * c->rows + k, c->tau[k], y + k);
    for (int i = 0; i < c->rows; i++) c->work[c->row[i]] = y[i];
    for (int i = 0; i < c->rows; i++) y[i] = c->work[i];
}

void cod_to_rows(const Cod *c, double *w, double *spare) {
    for (int j = 0; j < c->columns; j++) spare[j] = w[c->column[j]];
    for (int j = 0; j < c->columns; j++) w[j] = spare[j];
    for (int k = 0; k < c->rank; k++)
        reflect(c->columns - k, c->B + k * c->columns + k, c->tau_z[k], w + k);
}

void cod_from_rows(const Cod *c, double *w, double *spare) {
    for (int k = c->rank - 1; k >= 0; k--)
        reflect(c->columns - k, c->B + k * c->columns + k, c->tau_z[k], w + k);
    for (int j = 0; j < c->columns; j++) spare[c->column[j]] = w[j];
    for (int j = 0; j < c->columns; j++) w[j] = spare[j];
}

void cod_solve(const Cod *c, double *z) {
    for (int i = c->rank - 1; i >= 0; i--) {
        for (int j = i + 1; j < c->rank; j++) z[i] -= c->B[j * c->columns + i] * z[j];
        z[i] /= c->B[i * c->columns + i];
    }
}

void cod_solve_transposed(const Cod *c, double *z) {
    for (int i = 0; i < c->rank; i++) {
        for (int j = 0; j < i; j++) z[i] -= c->B[i * c->columns + j] * z[j];
        z[i] /= c->B[i * c->columns + i];
    }
}
