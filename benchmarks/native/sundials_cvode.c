/* sundials_cvode.c -- SUNDIALS CVODE on the index-1 equations  y = [q; v],  y' = [v; vdot],  with
 * its projection (CVodeSetProjFn) onto f = 0 and G v = nu after every step (Hindmarsh et al., ACM
 * TOMS 31 (2005) 363; Eich, SIAM J. Numer. Anal. 30 (1993) 1467 for BDF with projection).
 *
 *   cvode METHOD TOLERANCE STOP STEP BUDGET
 *
 * METHOD: bdf-newton  dense LU, Jacobian by CVODE's difference quotients
 *         bdf-exact   dense LU, exact Jacobian from System.tangent
 *         bdf-fixed   fixed-point iteration
 *         adams       Adams-Moulton, fixed-point iteration; CVODE projects BDF alone: NOT projected
 *         adams-newton  the same with Newton's iteration and the dense LU */
#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "equations.h"
#include "problem.h"
#include "stopwatch.h"

typedef struct {
    Equations e;
    void *cvode;
    N_Vector y, start, absolute, weights;
    double *work; /* 3 n + 2 m, and what the Jacobian needs */
} Peer;

static int rate(realtype t, N_Vector y, N_Vector ydot, void *data) {
    Peer *peer = data;
    const int n = peer->e.s->nv;
    const double *q = N_VGetArrayPointer(y);
    double *dydt = N_VGetArrayPointer(ydot);
    memcpy(dydt, q + n, (size_t)n * sizeof(double));
    return equations_motion(&peer->e, t, q, q + n, dydt + n, peer->work);
}

/* Columns of d[v; vdot]/dy: along each direction,
 * M dvdot = dF - dM vdot + dG^T lambda + G^T dlambda ,  G dvdot = dgamma - dG vdot . */
static int jacobian(realtype t, N_Vector y, N_Vector ydot, SUNMatrix J, void *data, N_Vector w1,
                    N_Vector w2, N_Vector w3) {
    Peer *peer = data;
    const System *s = peer->e.s;
    const int n = s->nv, m = s->m;
    const double *q = N_VGetArrayPointer(y), *v = q + n;
    double *lambda = peer->work, *vdot = lambda + m, *along = vdot + n, *b = along + 2 * n;
    double *dgamma = b + n, *dM = dgamma + m, *dG = dM + s->masses, *dnu = dG + s->entries;
    double *df = dnu + m, *dlambda = df + m, *denergy = dlambda + m;
    (void)ydot, (void)w1, (void)w2, (void)w3;
    if (equations_motion(&peer->e, t, q, v, vdot, lambda) != 0)
        return 1;
    SUNMatZero(J);
    memset(along, 0, 2 * (size_t)n * sizeof(double));
    for (int j = 0; j < 2 * n; j++) {
        double *column = SUNDenseMatrix_Column(J, j);
        along[j] = 1;
        s->tangent(t, q, v, NULL, peer->e.p, 0, along, along + n, NULL, dM, b, dG, dnu, dgamma, df,
                   denergy);
        along[j] = 0;
        mass_times(s, dM, -1, vdot, b);
        columns_times(s, dG, 1, lambda, b);
        rows_times(s, dG, -1, vdot, dgamma);
        if (equations_solve(&peer->e, b, dgamma, column + n, dlambda) != 0)
            return 1;
        if (j >= n)
            column[j - n] = 1;
    }
    return 0;
}

/* x <- x - M^-1 G^T S^-1 G x : the part of an error that projection leaves. */
static int strip(Peer *peer, double *x, double *c, double *dx, double *mu) {
    const System *s = peer->e.s;
    memset(c, 0, (size_t)s->m * sizeof(double));
    rows_times(s, peer->e.G, -1, x, c);
    if (equations_solve(&peer->e, NULL, c, dx, mu) != 0)
        return 1;
    for (int j = 0; j < s->nv; j++)
        x[j] += dx[j];
    return 0;
}

/* Mass-weighted Newton onto f(q) = 0 until a correction is below epsilon in CVODE's weighted norm;
 * the factors are those of the step's end.  Then one correction of v with G at the new q. */
static int project(realtype t, N_Vector y, N_Vector correction, realtype epsilon, N_Vector error,
                   void *data) {
    Peer *peer = data;
    const System *s = peer->e.s;
    const int n = s->nv, m = s->m;
    const double *q = N_VGetArrayPointer(y), *v = q + n;
    double *dq = N_VGetArrayPointer(correction), *dv = dq + n;
    double *mu = peer->work, *dx = mu + m, *moved = dx + n, *c = moved + 2 * n;
    const double *weight = N_VGetArrayPointer(peer->weights);
    double size = 2 * epsilon;
    equations_evaluate(&peer->e, t, q, v);
    if (equations_factor(&peer->e) != 0)
        return 1;
    CVodeGetErrWeights(peer->cvode, peer->weights);
    memset(dq, 0, 2 * (size_t)n * sizeof(double));
    memcpy(moved, q, (size_t)n * sizeof(double));
    for (int k = 0; size > epsilon; k++) {
        if (k == 10)
            return 1;
        s->residual(t, moved, NULL, peer->e.p, c);
        for (int i = 0; i < m; i++)
            c[i] = -c[i];
        if (equations_solve(&peer->e, NULL, c, dx, mu) != 0)
            return 1;
        size = 0;
        for (int j = 0; j < n; j++) {
            dq[j] += dx[j];
            moved[j] = q[j] + dq[j];
            size += dx[j] * weight[j] * dx[j] * weight[j];
        }
        size = sqrt(size / (2 * n));
    }
    if (error != NULL) {
        double *err = N_VGetArrayPointer(error);
        if (strip(peer, err, c, dx, mu) != 0 || strip(peer, err + n, c, dx, mu) != 0)
            return 1;
    }
    equations_evaluate(&peer->e, t, moved, v);
    memcpy(c, peer->e.nu, (size_t)m * sizeof(double));
    rows_times(s, peer->e.G, -1, v, c);
    return equations_solve(&peer->e, NULL, c, dv, mu);
}

static int run(void *context, const Task *task, double *lambda, Cost *cost) {
    Peer *peer = context;
    const int n = peer->e.s->nv, m = peer->e.s->m;
    const double *q = N_VGetArrayPointer(peer->y);
    N_VScale(1, peer->start, peer->y);
    if (CVodeReInit(peer->cvode, 0, peer->start) != CV_SUCCESS)
        return 1;
    peer->e.evaluations = 0;
    const double begun = now_ns();
    for (int i = 0; i < task->samples; i++) {
        const double bound = task->step * (i + 1);
        double t;
        if (CVode(peer->cvode, bound, peer->y, &t, CV_NORMAL) < 0)
            return 1;
        if (equations_motion(&peer->e, bound, q, q + n, peer->work + m, lambda + i * m) != 0)
            return 1;
    }
    cost->ns = now_ns() - begun;
    CVodeGetNumSteps(peer->cvode, &cost->steps);
    cost->evaluations = peer->e.evaluations;
    return 0;
}

int main(int argc, char *argv[]) {
    const System *s = MODEL_SYSTEM;
    const int n = s->nv;
    Peer peer;
    SUNContext sun;
    if (argc != 6)
        return 64;
    const char *method = argv[1];
    const Task task = task_of(argv, 2);
    const int bdf = strncmp(method, "bdf", 3) == 0;
    if (SUNContext_Create(NULL, &sun) != 0 || equations_create(&peer.e, s, PROBLEM_P) != 0)
        return 1;
    peer.work = calloc((size_t)(8 * n + 8 * s->m + s->masses + s->entries + 2), sizeof(double));
    peer.y = N_VNew_Serial(2 * n, sun);
    peer.start = N_VNew_Serial(2 * n, sun);
    peer.absolute = N_VNew_Serial(2 * n, sun);
    peer.weights = N_VNew_Serial(2 * n, sun);
    for (int j = 0; j < 2 * n; j++) {
        N_VGetArrayPointer(peer.start)[j] = j < n ? PROBLEM_Q[j] : PROBLEM_V[j - n];
        N_VGetArrayPointer(peer.absolute)[j] = task.tolerance * PROBLEM_SCALE[j];
    }
    peer.cvode = CVodeCreate(bdf ? CV_BDF : CV_ADAMS, sun);
    SUNMatrix A = SUNDenseMatrix(2 * n, 2 * n, sun);
    SUNLinearSolver solver = SUNLinSol_Dense(peer.start, A, sun);
    SUNNonlinearSolver fixed = SUNNonlinSol_FixedPoint(peer.start, 0, sun);
    int bad = CVodeInit(peer.cvode, rate, 0, peer.start);
    bad |= CVodeSVtolerances(peer.cvode, task.tolerance, peer.absolute);
    bad |= CVodeSetUserData(peer.cvode, &peer);
    bad |= CVodeSetMaxNumSteps(peer.cvode, 100000000);
    if (strcmp(method, "bdf-fixed") == 0 || strcmp(method, "adams") == 0)
        bad |= CVodeSetNonlinearSolver(peer.cvode, fixed);
    else
        bad |= CVodeSetLinearSolver(peer.cvode, solver, A);
    if (strcmp(method, "bdf-exact") == 0)
        bad |= CVodeSetJacFn(peer.cvode, jacobian);
    if (bdf)
        bad |= CVodeSetProjFn(peer.cvode, project);
    const int status = bad != 0 ? 1 : measure(&task, run, &peer, s->m);
    CVodeFree(&peer.cvode);
    SUNNonlinSolFree(fixed);
    SUNLinSolFree(solver);
    SUNMatDestroy(A);
    N_VDestroy(peer.y);
    N_VDestroy(peer.start);
    N_VDestroy(peer.absolute);
    N_VDestroy(peer.weights);
    free(peer.work);
    equations_destroy(&peer.e);
    SUNContext_Free(&sun);
    return status;
}
