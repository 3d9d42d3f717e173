/* lu.c -- dense LU with partial pivoting (Golub & Van Loan, Matrix Computations, algorithm 3.4.1). */
#include "lu.h"

#include <math.h>

int lu_factor(int n, double *A, int *pivots) {
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i * n + k]) > fabs(A[best * n + k])) best = i;
        pivots[k] = best;
        if (!(fabs(A[best * n + k]) > 0)) return 1 + k;
        if (best != k)
            for (int j = 0; j < n; j++) {
                double swapped = A[k * n + j];
                A[k * n + j] = A[best * n + j];
                A[best * n + j] = swapped;
            }
        for (int i = k + 1; i < n; i++) {
            double factor = A[i * n + k] /= A[k * n + k];
            if (factor != 0)
                for (int j = k + 1; j < n; j++) A[i * n + j] -= factor * A[k * n + j];
        }
    }
    return 0;
}

void lu_solve(int n, const double *A, const int *pivots, double *b) {
    for (int k = 0; k < n; k++) {
        double swapped = b[k];
        b[k] = b[pivots[k]];
        b[pivots[k]] = swapped;
    }
    for (int i = 1; i < n; i++)
        for (int j = 0; j < i; j++) b[i] -= A[i * n + j] * b[j];
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) b[i] -= A[i * n + j] * b[j];
        b[i] /= A[i * n + i];
    }
}

int lu_factor_complex(int n, double *A_re, double *A_im, int *pivots) {
    for (int k = 0; k < n; k++) {
        int best = k;
        double largest = -1;
        for (int i = k; i < n; i++) {
            double size = fabs(A_re[i * n + k]) + fabs(A_im[i * n + k]);
            if (size > largest) {
                largest = size;
                best = i;
            }
        }
        pivots[k] = best;
        if (!(largest > 0)) return 1 + k;
        if (best != k)
            for (int j = 0; j < n; j++) {
                double re = A_re[k * n + j], im = A_im[k * n + j];
                A_re[k * n + j] = A_re[best * n + j];
                A_im[k * n + j] = A_im[best * n + j];
                A_re[best * n + j] = re;
                A_im[best * n + j] = im;
            }
        double p_re = A_re[k * n + k], p_im = A_im[k * n + k];
        double square = p_re * p_re + p_im * p_im;
        int *places = pivots + k + 1, count = 0; /* what is not zero in the row of the pivot; later pivots come there */
        for (int j = k + 1; j < n; j++)
            if (A_re[k * n + j] != 0 || A_im[k * n + j] != 0) places[count++] = j;
        for (int i = k + 1; i < n; i++) {
            double *re = A_re + i * n, *im = A_im + i * n, a_re = re[k], a_im = im[k];
            if (a_re == 0 && a_im == 0) continue;
            double f_re = (a_re * p_re + a_im * p_im) / square;
            double f_im = (a_im * p_re - a_re * p_im) / square;
            re[k] = f_re;
            im[k] = f_im;
            for (int l = 0; l < count; l++) {
                const int j = places[l];
                re[j] -= f_re * A_re[k * n + j] - f_im * A_im[k * n + j];
                im[j] -= f_re * A_im[k * n + j] + f_im * A_re[k * n + j];
            }
        }
    }
    return 0;
}

void lu_solve_complex(int n, const double *A_re, const double *A_im, const int *pivots,
                      double *b_re, double *b_im) {
    for (int k = 0; k < n; k++) {
        double re = b_re[k], im = b_im[k];
        b_re[k] = b_re[pivots[k]];
        b_im[k] = b_im[pivots[k]];
        b_re[pivots[k]] = re;
        b_im[pivots[k]] = im;
    }
    for (int i = 1; i < n; i++)
        for (int j = 0; j < i; j++) {
            double re = A_re[i * n + j], im = A_im[i * n + j];
            b_re[i] -= re * b_re[j] - im * b_im[j];
            b_im[i] -= re * b_im[j] + im * b_re[j];
        }
    for (int i = n - 1; i >= 0; i--) {
        for (int j = i + 1; j < n; j++) {
            double re = A_re[i * n + j], im = A_im[i * n + j];
            b_re[i] -= re * b_re[j] - im * b_im[j];
            b_im[i] -= re * b_im[j] + im * b_re[j];
        }
        double re = A_re[i * n + i], im = A_im[i * n + i];
        double square = re * re + im * im;
        double x = (b_re[i] * re + b_im[i] * im) / square;
        b_im[i] = (b_im[i] * re - b_re[i] * im) / square;
        b_re[i] = x;
    }
}
