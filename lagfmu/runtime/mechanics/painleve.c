/* painleve.c -- does sliding have one acceleration, whatever the forces?
 *
 * With B = G_n M^-1 (G_n^T - sign mu G_t^T s/|s|) over the contacts that touch, their laws have exactly one
 * solution if B is a P-matrix: all principal minors are positive (Cottle, Pang & Stone, The Linear
 * Complementarity Problem, 1992, th. 3.3.7; Pfeiffer & Glocker 1996).  The minor of the contacts that stay
 * closed is det B times the one of B^-1 over those that open; B^-1 = (1 + A)^-1 K^-1 comes from unit
 * accelerations of each contact.  Over the same minor without friction it is 1 + A with those open. */
#include "friction.h"

#include <string.h>

#include "digits.h"

enum { PAINLEVE_OPENED = 8, PAINLEVE_ROWS = 16 }; /* contacts that are combined, and their rows */

Status painleve_paradox(const Mechanism *b, double t, const int *which, int count, double value) {
    fail(b->why, "friction ");
    for (int i = 0; i < count; i++)
        why_append(b->why, "%s'%s'", i > 0 ? ", " : "", b->system->friction[which[i]].name);
    why_append(b->why,
               ": sliding has no acceleration, or several, at t = %s s (Painleve's paradox: the normal "
               "force would drive itself, 1 + A = %.3g, expected above 0): use a smaller coefficient of "
               "friction, or let the bodies deform (a spring in the contact); if it is meant never to slip, "
               "leave the friction out and let its constraints act with the contact (while_closed)",
               digits(t).text, value);
    return FAILED;
}

double painleve_eliminate(int size, double *A, double *right) {
    double determinant = 1;
    for (int k = 0; k < size; k++) {
        int top = k;
        for (int i = k + 1; i < size; i++)
            if (fabs(A[i * size + k]) > fabs(A[top * size + k])) top = i;
        if (A[top * size + k] == 0) return 0;
        if (top != k) {
            for (int j = 0; j < size; j++) {
                const double held = A[k * size + j];
                A[k * size + j] = A[top * size + j];
                A[top * size + j] = held;
            }
            const double held = right[k];
            right[k] = right[top];
            right[top] = held;
            determinant = -determinant;
        }
        determinant *= A[k * size + k];
        for (int i = k + 1; i < size; i++) {
            const double part = A[i * size + k] / A[k * size + k];
            for (int j = k; j < size; j++) A[i * size + j] -= part * A[k * size + j];
            right[i] -= part * right[k];
        }
    }
    for (int k = size - 1; k >= 0; k--) {
        for (int j = k + 1; j < size; j++) right[k] -= A[k * size + j] * right[j];
        right[k] /= A[k * size + k];
    }
    return determinant;
}

/* The contacts that are closed, then what acts only while they are; 0 if they are less than two, or too
 * many. */
static int find_sliding_rows(const Mechanism *b, int *rows, int *contacts) {
    const System *s = b->system;
    const int *acting = b->friction->acting;
    int count = 0;
    for (int c = 0; c < s->contacts; c++) {
        if (!acting[s->contact[c]]) continue;
        if (count == PAINLEVE_OPENED) return 0;
        rows[count++] = s->contact[c];
    }
    *contacts = count;
    if (count < 2) return 0;
    for (int k = 0; k < s->m; k++) {
        const Row *row = &s->rows[k];
        const int gated = row->while_closed >= 0 ||
                          (row->friction > 0 && s->friction[row->friction - 1].gated);
        if (!acting[k] || !gated) continue;
        if (count == PAINLEVE_ROWS) return 0;
        rows[count++] = k;
    }
    for (int r = 0; r < count; r++)
        if (!b->linear.unique[rows[r]]) return 0; /* redundant: there is no K^-1 */
    return count;
}

/* Does row k no longer act, as the contacts of `mask` open? */
static int opens(const Mechanism *b, int k, const int *rows, int contacts, unsigned mask) {
    const System *s = b->system;
    const Row *row = &s->rows[k];
    int closed = 0;
    for (int c = 0; c < contacts; c++) {
        if (mask >> c & 1u) continue;
        closed |= rows[c] == k || rows[c] == row->while_closed;
        if (row->friction == 0) continue;
        const Friction *law = &s->friction[row->friction - 1];
        for (int n = law->first; n < law->first + law->normals; n++) closed |= rows[c] == s->normal_row[n];
    }
    return !closed;
}

/* The determinant of the rows and columns in `which`. */
static double minor(const double *X, int count, const int *which) {
    double part[PAINLEVE_ROWS * PAINLEVE_ROWS], none[PAINLEVE_ROWS] = {0};
    int size = 0;
    for (int i = 0; i < count; i++) size += which[i];
    for (int i = 0, at = 0; i < count; i++)
        for (int j = 0; j < count && which[i]; j++)
            if (which[j]) part[at++] = X[i * count + j];
    return painleve_eliminate(size, part, none);
}

/* Column r of K^-1 and of B^-1: multipliers to a unit acceleration of row r. */
static Status respond_to_row(Mechanism *b, int sliding, const int *rows, int count, int r, double *K,
                             double *B) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    f->zero[rows[r]] = 1;
    const Status solved = linear_solve(&b->linear, NULL, f->zero, f->d, f->first);
    f->zero[rows[r]] = 0;
    if (solved != OK) return FAILED;
    for (int h = 0; h < sliding; h++) {
        const int i = f->sliding[h];
        f->right[h] = f->stick_slip[i].sign * (friction_normal(b, i, f->first) - f->load[i]);
    }
    memcpy(f->A, f->minor, (size_t)(sliding * sliding) * sizeof *f->A);
    (void)painleve_eliminate(sliding, f->A, f->right);
    for (int j = 0; j < count; j++) {
        K[j * count + r] = B[j * count + r] = f->first[rows[j]];
        for (int h = 0; h < sliding; h++)
            B[j * count + r] -=
                friction_sliding(f, f->sliding[h]) * f->right[h] * f->pushed[h * s->m + rows[j]];
    }
    return OK;
}

Status painleve_departures(Mechanism *b, double t, int sliding, double determinant) {
    double K[PAINLEVE_ROWS * PAINLEVE_ROWS], B[PAINLEVE_ROWS * PAINLEVE_ROWS];
    int rows[PAINLEVE_ROWS], which[PAINLEVE_ROWS], contacts;
    const int count = find_sliding_rows(b, rows, &contacts);
    for (int r = 0; r < count; r++)
        if (respond_to_row(b, sliding, rows, count, r, K, B) != OK) return FAILED;
    for (unsigned mask = 1; count > 0 && mask < 1u << contacts; mask++) {
        for (int r = 0; r < count; r++) which[r] = opens(b, rows[r], rows, contacts, mask);
        const double left = determinant * minor(B, count, which) / minor(K, count, which);
        if (!(left > PAINLEVE_SAFE)) return painleve_paradox(b, t, b->friction->sliding, sliding, left);
    }
    return OK;
}
