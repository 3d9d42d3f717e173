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
    int moved;
    const char *moved_name[64];
    int moved_velocity[64];
    double given[64], used[64];
    Priority priority[64]; /* of the start values */
} Bench;

void *bench_open(const System *system);
void bench_close(Bench *b);
const char *bench_why(const Bench *b);
int bench_start(Bench *b, double t, const double *q, const double *v, double tolerance);
int bench_advance(Bench *b, double t_end);
int bench_observe(Bench *b);
int bench_motion(Bench *b, double t, const double *q, const double *v, const int *active);
int bench_project(Bench *b, double t, double *q, double *v, const int *active);
int bench_modes(Bench *b, const double *q, const double *v, int *closed, const int *touching,
                const int *departing);
int bench_impact(Bench *b, const double *q, double *v, const int *entering, int plastic,
                 double *Lambda);
int bench_impacts(Bench *b, const double *q, double *v, const int *touching, const double *slow,
                  int *struck);
int bench_moved(const Bench *b, int i, const char **name, double *given, double *used);
void bench_drive(const Bench *b, double t, double *u);
void *bench_array(Bench *b, const char *name);
double bench_number(const Bench *b, const char *name);
void bench_count(Bench *b);
void bench_ahead(Bench *b);
void *bench_solver(Bench *b);

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

static void moved(void *context, const char *coordinate, int is_velocity, double given,
                  double used, Priority priority) {
    (void)priority;
    Bench *b = context;
    int i = b->moved++;
    if (i >= 64) return;
    b->moved_name[i] = coordinate;
    b->moved_velocity[i] = is_velocity;
    b->given[i] = given;
    b->used[i] = used;
}

int bench_moved(const Bench *b, int i, const char **name, double *given, double *used) {
    if (i >= b->moved) return -1;
    *name = b->moved_name[i];
    *given = b->given[i];
    *used = b->used[i];
    return b->moved_velocity[i];
}

int bench_start(Bench *b, double t, const double *q, const double *v, double tolerance) {
    b->moved = 0;
    b->solver.settings = (Settings){DOP853, tolerance, 0, 0, 1e6};
    b->solver.drive.since = t;
    return solver_start(&b->solver, t, q, v, b->priority, moved, b);
}

int bench_advance(Bench *b, double t_end) { return solver_advance(&b->solver, t_end); }

int bench_observe(Bench *b) { return solver_observe(&b->solver, &b->seen); }

static Instant instant(Bench *b, double t) {
    drive_at(b->solver.system, &b->solver.drive, t, b->solver.u);
    return (Instant){t, b->solver.u, b->solver.p};
}

int bench_motion(Bench *b, double t, const double *q, const double *v, const int *active) {
    return mechanism_motion(&b->solver.stepped, instant(b, t), q, v, active);
}

int bench_project(Bench *b, double t, double *q, double *v, const int *active) {
    State *x = &b->solver.state;
    return mechanism_project(&b->solver.stepped, instant(b, t), q, v, active, x->offset, x->size);
}

int bench_modes(Bench *b, const double *q, const double *v, int *closed, const int *touching,
                const int *departing) {
    return contacts_modes(&b->solver, instant(b, b->solver.state.now.t), q, v, closed, touching,
                          departing);
}

int bench_impact(Bench *b, const double *q, double *v, const int *entering, int plastic,
                 double *Lambda) {
    return impact(&b->solver, instant(b, b->solver.state.now.t), q, v, entering, plastic, Lambda);
}

int bench_impacts(Bench *b, const double *q, double *v, const int *touching, const double *slow,
                  int *struck) {
    return impacts(&b->solver, instant(b, b->solver.state.now.t), q, v, touching, slow, struck);
}

void bench_drive(const Bench *b, double t, double *u) {
    drive_at(b->solver.system, &b->solver.drive, t, u);
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

/* A state with a step and an event ahead. */
void bench_ahead(Bench *b) {
    Numbers *now = &b->solver.state.now;
    now->ahead = now->event_count = 1;
    now->step = 0.125;
    now->fresh = 0;
}

void *bench_solver(Bench *b) { return &b->solver; }

double bench_number(const Bench *b, const char *name) {
    const Numbers *now = &b->solver.state.now;
    if (strcmp(name, "evaluations") == 0) return evaluations;
    if (strcmp(name, "residuals") == 0) return residuals;
    if (strcmp(name, "t") == 0) return now->t;
    if (strcmp(name, "rate") == 0) return now->rate;
    if (strcmp(name, "step") == 0) return now->step;
    if (strcmp(name, "steps") == 0) return (double)now->steps;
    if (strcmp(name, "ahead") == 0) return now->ahead;
    if (strcmp(name, "fresh") == 0) return now->fresh;
    if (strcmp(name, "event_count") == 0) return now->event_count;
    if (strcmp(name, "rung") == 0) return (double)b->solver.stepped.linear.rung;
    if (strcmp(name, "kinetic") == 0) return b->seen.energy[0];
    return b->seen.energy[1];
}

void *bench_array(Bench *b, const char *name) {
    Solver *s = &b->solver;
    const Latest *left = &s->state.latest[DEPARTURE];
    const int embedded = s->system->embed != NULL;
    const struct {
        const char *name;
        void *values;
    } all[] = {
        {"state.q", s->state.q}, {"state.v", s->state.v}, {"state.offset", s->state.offset},
        {"state.scale", s->state.scale}, {"state.size", s->state.size}, {"state.gap", s->state.gap},
        {"state.closed", s->state.closed}, {"state.armed", s->state.armed},
        {"state.count", left->count}, {"state.departure_time", left->time},
        {"state.departure_q", left->q}, {"state.departure_v", left->v},
        {"priority", b->priority}, {"active", s->active}, {"p", s->p}, {"value", s->drive.value}, {"first", s->drive.first},
        {"second", s->drive.second}, {"M", s->stepped.M}, {"G", s->stepped.G},
        {"vdot", s->stepped.vdot}, {"lambda", s->stepped.lambda},
        {"seen.q", b->seen.q}, {"seen.v", b->seen.v}, {"seen.vdot", b->seen.vdot},
        {"seen.lambda", b->seen.lambda}, {"seen.residual", b->seen.residual},
        {"seen.unique", b->seen.unique}, {"seen.force", b->seen.force},
        {"seen.share", b->seen.share}, {"seen.s", b->seen.s}, {"seen.sdot", b->seen.sdot},
        {"seen.sddot", b->seen.sddot}, {"seen.departure_q", embedded ? b->seen.latest_q[DEPARTURE] : left->q},
        {"seen.departure_v", embedded ? b->seen.latest_v[DEPARTURE] : left->v},
        {"seen.own", b->seen.own},
    };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (strcmp(all[i].name, name) == 0) return all[i].values;
    return NULL;
}
