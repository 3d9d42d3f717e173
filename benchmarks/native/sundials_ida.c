/* sundials_ida.c -- SUNDIALS IDA on the stabilized equations of index 2 (Gear, Gupta & Leimkuhler,
 * J. Comput. Appl. Math. 12/13 (1985) 77), y = [q; v; lambda; mu]:
 *
 *   q' - v - G^T mu = 0 ,  M v' - F - G^T lambda = 0 ,  f(q, t) = 0 ,  G v - nu = 0
 *
 * lambda and mu are left out of the error test (IDASetSuppressAlg), as IDA's guide advises for
 * index 2; the lambda that is reported is the one of the index-1 equations at (q, v), which is
 * closer.
 *
 *   ida METHOD TOLERANCE STOP STEP BUDGET
 *
 * METHOD: newton (dense LU, difference quotients), exact (Jacobian from System.tangent). */
#include <ida/ida.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "equations.h"
#include "problem.h"
#include "stopwatch.h"

typedef struct {
    Equations e;
    void *ida;
    N_Vector y, dydt, start, rate, absolute, differential;
    double *work;
} Peer;

static int residual(realtype t, N_Vector y_, N_Vector dydt_, N_Vector r_, void *data) {
    Peer *peer = data;
    Equations *e = &peer->e;
    const System *s = e->s;
    const int n = s->nv, m = s->m;
    const double *q = N_VGetArrayPointer(y_), *v = q + n, *lambda = v + n, *mu = lambda + m;
    const double *qdot = N_VGetArrayPointer(dydt_), *vdot = qdot + n;
    double *r = N_VGetArrayPointer(r_), *r2 = r + n, *f = r2 + n, *r4 = f + m;
    equations_evaluate(e, t, q, v);
    for (int j = 0; j < n; j++) {
        r[j] = qdot[j] - v[j];
        r2[j] = -e->F[j];
    }
    columns_times(s, e->G, -1, mu, r);
    mass_times(s, e->M, 1, vdot, r2);
    columns_times(s, e->G, -1, lambda, r2);
    s->residual(t, q, NULL, e->p, f);
    for (int k = 0; k < m; k++)
        r4[k] = -e->nu[k];
    rows_times(s, e->G, 1, v, r4);
    return 0;
}

/* Columns of dr/dy + cj dr/dy'. */
static int jacobian(realtype t, realtype cj, N_Vector y_, N_Vector dydt_, N_Vector r_, SUNMatrix J,
                    void *data, N_Vector w1, N_Vector w2, N_Vector w3) {
    Peer *peer = data;
    Equations *e = &peer->e;
    const System *s = e->s;
    const int n = s->nv, m = s->m;
    const double *q = N_VGetArrayPointer(y_), *v = q + n, *lambda = v + n, *mu = lambda + m;
    const double *vdot = N_VGetArrayPointer(dydt_) + n;
    double *along = peer->work, *dM = along + 2 * n, *dF = dM + s->masses, *dG = dF + n;
    double *dnu = dG + s->entries, *dgamma = dnu + m, *df = dgamma + m, *denergy = df + m;
    (void)r_, (void)w1, (void)w2, (void)w3;
    equations_evaluate(e, t, q, v);
    SUNMatZero(J);
    memset(along, 0, 2 * (size_t)n * sizeof(double));
    for (int j = 0; j < 2 * n; j++) {
        double *r = SUNDenseMatrix_Column(J, j), *r2 = r + n, *r3 = r2 + n, *r4 = r3 + m;
        along[j] = 1;
        s->tangent(t, q, v, NULL, e->p, 0, along, along + n, NULL, dM, dF, dG, dnu, dgamma, df,
                   denergy);
        if (j < n)
            r[j] += cj;
        else
            r[j - n] -= 1;
        columns_times(s, dG, -1, mu, r);
        mass_times(s, dM, 1, vdot, r2);
        for (int i = 0; i < n; i++)
            r2[i] -= dF[i];
        columns_times(s, dG, -1, lambda, r2);
        if (j >= n)
            mass_times(s, e->M, cj, along + n, r2);
        memcpy(r3, df, (size_t)m * sizeof(double));
        rows_times(s, dG, 1, v, r4);
        for (int k = 0; k < m; k++)
            r4[k] -= dnu[k];
        if (j >= n)
            rows_times(s, e->G, 1, along + n, r4);
        along[j] = 0;
    }
    for (int k = 0; k < s->entries; k++) {
        const int i = s->entry_row[k], j = s->entry_column[k];
        SUNDenseMatrix_Column(J, 2 * n + i)[n + j] -= e->G[k];
        SUNDenseMatrix_Column(J, 2 * n + m + i)[j] -= e->G[k];
    }
    return 0;
}

static int run(void *context, const Task *task, double *lambda, Cost *cost) {
    Peer *peer = context;
    const int n = peer->e.s->nv, m = peer->e.s->m;
    const double *q = N_VGetArrayPointer(peer->y);
    N_VScale(1, peer->start, peer->y);
    N_VScale(1, peer->rate, peer->dydt);
    if (IDAReInit(peer->ida, 0, peer->start, peer->rate) != IDA_SUCCESS)
        return 1;
    peer->e.evaluations = 0;
    const double begun = now_ns();
    for (int i = 0; i < task->samples; i++) {
        const double bound = task->step * (i + 1);
        double t;
        if (IDASolve(peer->ida, bound, &t, peer->y, peer->dydt, IDA_NORMAL) < 0)
            return 1;
        if (equations_motion(&peer->e, bound, q, q + n, peer->work, lambda + i * m) != 0)
            return 1;
    }
    cost->ns = now_ns() - begun;
    IDAGetNumSteps(peer->ida, &cost->steps);
    cost->evaluations = peer->e.evaluations;
    return 0;
}

int main(int argc, char *argv[]) {
    const System *s = MODEL_SYSTEM;
    const int n = s->nv, m = s->m, ny = 2 * (n + m);
    Peer peer;
    SUNContext sun;
    if (argc != 6)
        return 64;
    const Task task = task_of(argv, 2);
    if (SUNContext_Create(NULL, &sun) != 0 || equations_create(&peer.e, s, PROBLEM_P) != 0)
        return 1;
    peer.work = calloc((size_t)(4 * n + 4 * m + s->masses + s->entries + 2), sizeof(double));
    peer.y = N_VNew_Serial(ny, sun);
    peer.dydt = N_VNew_Serial(ny, sun);
    peer.start = N_VNew_Serial(ny, sun);
    peer.rate = N_VNew_Serial(ny, sun);
    peer.absolute = N_VNew_Serial(ny, sun);
    peer.differential = N_VNew_Serial(ny, sun);
    N_VConst(0, peer.start);
    N_VConst(0, peer.rate);
    N_VConst(task.tolerance, peer.absolute);
    N_VConst(0, peer.differential);
    double *y = N_VGetArrayPointer(peer.start), *dydt = N_VGetArrayPointer(peer.rate);
    memcpy(y, PROBLEM_Q, (size_t)n * sizeof(double));
    memcpy(y + n, PROBLEM_V, (size_t)n * sizeof(double));
    memcpy(dydt, PROBLEM_V, (size_t)n * sizeof(double));
    if (equations_motion(&peer.e, 0, y, y + n, dydt + n, y + 2 * n) != 0)
        return 1;
    for (int j = 0; j < 2 * n; j++) {
        N_VGetArrayPointer(peer.absolute)[j] = task.tolerance * PROBLEM_SCALE[j];
        N_VGetArrayPointer(peer.differential)[j] = 1;
    }
    peer.ida = IDACreate(sun);
    SUNMatrix A = SUNDenseMatrix(ny, ny, sun);
    SUNLinearSolver solver = SUNLinSol_Dense(peer.start, A, sun);
    int bad = IDAInit(peer.ida, residual, 0, peer.start, peer.rate);
    bad |= IDASVtolerances(peer.ida, task.tolerance, peer.absolute);
    bad |= IDASetUserData(peer.ida, &peer);
    bad |= IDASetInitStep(peer.ida, 0.01 * sqrt(task.tolerance)); /* its own choice fails at 1e-8 */
    bad |= IDASetMaxNumSteps(peer.ida, 100000000);
    bad |= IDASetId(peer.ida, peer.differential);
    bad |= IDASetSuppressAlg(peer.ida, SUNTRUE);
    bad |= IDASetLinearSolver(peer.ida, solver, A);
    if (strcmp(argv[1], "exact") == 0)
        bad |= IDASetJacFn(peer.ida, jacobian);
    const int status = bad != 0 ? 1 : measure(&task, run, &peer, m);
    IDAFree(&peer.ida);
    SUNLinSolFree(solver);
    SUNMatDestroy(A);
    N_VDestroy(peer.y);
    N_VDestroy(peer.dydt);
    N_VDestroy(peer.start);
    N_VDestroy(peer.rate);
    N_VDestroy(peer.absolute);
    N_VDestroy(peer.differential);
    free(peer.work);
    equations_destroy(&peer.e);
    SUNContext_Free(&sun);
    return status;
}
