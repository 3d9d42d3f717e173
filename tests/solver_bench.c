/* solver_bench.c -- the solver behind plain functions, for tests through ctypes.  All memory starts
 * as values that are no numbers, so that nothing unset can pass for a result. */
#include "contacts.h"
#include "impact.h"
#include "solver.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    Solver solver;
    Observed seen;
    void *memory[3];
    Priority priority[64]; /* of the start values */
} Bench;

static const int NONE[64]; /* of so many contacts none is dead */

void *bench_open(const System *system);
void bench_close(Bench *b);
const char *bench_why(const Bench *b);
int bench_start(Bench *b, const double *q, const double *v, double tolerance);
int bench_advance(Bench *b, double t_end);
int bench_observe(Bench *b);
int bench_motion(Bench *b, const double *q, const double *v, const int *active);
int bench_project(Bench *b, double *q, double *v, const int *active);
int bench_modes(Bench *b, const double *q, const double *v, int *closed, const int *touching,
                const int *departing);
int bench_impact(Bench *b, const double *q, double *v, const int *entering, int plastic,
                 double *Lambda);
int bench_impacts(Bench *b, const double *q, double *v, const int *touching, const double *slow,
                  int *struck);
void *bench_array(Bench *b, const char *name);
double bench_number(const Bench *b, const char *name);
void bench_count(Bench *b);

void *bench_open(const System *system) {
    Bench *b = calloc(1, sizeof *b);
    Arena saved = {NULL, 0}, scratch = {NULL, 0}, seen = {NULL, 0};
    if (b == NULL) return NULL;
    for (int pass = 0; pass < 2; pass++) {
        solver_layout(&b->solver, &saved, &scratch, system);
        observed_layout(&b->seen, &seen, system);
        if (pass == 1) break;
        Arena *all[3] = {&saved, &scratch, &seen};
        for (int i = 0; i < 3; i++) {
            b->memory[i] = malloc(all[i]->used + 1);
            if (b->memory[i] == NULL) return NULL;
            memset(b->memory[i], 0xff, all[i]->used); /* every double is not a number */
            *all[i] = (Arena){b->memory[i], 0};
        }
    }
    for (int i = 0; i < 64; i++) b->priority[i] = GIVEN;
    memset(b->solver.drive.value, 0, (size_t)system->inputs * sizeof(double));
    memset(b->solver.drive.first, 0, (size_t)system->inputs * sizeof(double));
    memset(b->solver.drive.second, 0, (size_t)system->inputs * sizeof(double));
    return b;
}

void bench_close(Bench *b) {
    for (int i = 0; i < 3; i++) free(b->memory[i]);
    free(b);
}

const char *bench_why(const Bench *b) { return b->solver.why.text; }

static void moved(void *context, int j, double given, double used, Priority priority) {
    (void)context, (void)j, (void)given, (void)used, (void)priority;
}

int bench_start(Bench *b, const double *q, const double *v, double tolerance) {
    b->solver.settings = (Settings){AUTO, tolerance, 0, 0, 1e6};
    b->solver.drive.since = 0;
    return solver_start(&b->solver, 0, q, v, b->priority, moved, b);
}

int bench_advance(Bench *b, double t_end) { return solver_advance(&b->solver, t_end); }

int bench_observe(Bench *b) { return solver_observe(&b->solver, &b->seen); }

/* of the start of the run */
static Instant instant(Bench *b) {
    drive_at(b->solver.system, &b->solver.drive, 0, b->solver.u);
    return (Instant){0, b->solver.u, b->solver.p};
}

int bench_motion(Bench *b, const double *q, const double *v, const int *active) {
    return mechanism_motion(&b->solver.stepped, instant(b), q, v, active);
}

int bench_project(Bench *b, double *q, double *v, const int *active) {
    State *x = &b->solver.state;
    return mechanism_project(&b->solver.stepped, instant(b), q, v, active, x->offset, x->span);
}

int bench_modes(Bench *b, const double *q, const double *v, int *closed, const int *touching,
                const int *departing) {
    return contacts_modes(&b->solver, instant(b), q, v, closed, touching,
                          departing);
}

int bench_impact(Bench *b, const double *q, double *v, const int *entering, int plastic,
                 double *Lambda) {
    return impact(&b->solver, instant(b), q, v, entering, plastic ? NULL : NONE, Lambda);
}

int bench_impacts(Bench *b, const double *q, double *v, const int *touching, const double *slow,
                  int *struck) {
    return impacts(&b->solver, instant(b), q, v, touching, slow, NONE, struck);
}

/* From now on evaluations are counted. */
static const System *counted;
static int evaluations, residuals;

static void dynamics(double t, const double *q, const double *v, const double *u, const double *p,
                     double *M, double *F, double *G, double *nu, double *gamma) {
    evaluations++;
    counted->dynamics(t, q, v, u, p, M, F, G, nu, gamma);
}

static void residual(double t, const double *q, const double *u, const double *p, double *f) {
    residuals++;
    counted->residual(t, q, u, p, f);
}

void bench_count(Bench *b) {
    static System counting;
    counted = b->solver.system;
    counting = *counted;
    counting.dynamics = dynamics;
    counting.residual = residual;
    b->solver.stepped.system = &counting;
    evaluations = residuals = 0;
}

double bench_number(const Bench *b, const char *name) {
    const Numbers *now = &b->solver.state.now;
    if (strcmp(name, "evaluations") == 0) return evaluations;
    if (strcmp(name, "residuals") == 0) return residuals;
    if (strcmp(name, "plain") == 0) return linear_plain(&b->solver.stepped.linear);
    return (double)now->rate;
}

void *bench_array(Bench *b, const char *name) {
    Solver *s = &b->solver;
    const struct {
        const char *name;
        void *values;
    } all[] = {
        {"state.q", s->state.q}, {"state.v", s->state.v}, {"state.offset", s->state.offset},
        {"state.size", s->state.size},
        {"priority", b->priority}, {"active", s->active}, {"p", s->p}, {"value", s->drive.value},
        {"vdot", s->stepped.vdot}, {"lambda", s->stepped.lambda},
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (strcmp(all[i].name, name) == 0) return all[i].values;
    return NULL;
}
