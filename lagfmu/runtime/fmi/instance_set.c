/* instance_set.c -- what an importer sets: start values, parameters, solver settings, inputs. */
#include "instance.h"

#include "algebraic.h"
#include "prescribed.h"

int instance_was_set(const Instance *x, const Variable *v, double *value) {
    const Solver *s = &x->solver;
    switch (v->place) {
        case AT_PARAMETER: *value = s->p[v->index]; return 1;
        case AT_METHOD: *value = (double)x->given.method; return 1;
        case AT_TOLERANCE: *value = x->given.tolerance; return 1;
        case AT_STEP: *value = x->given.step; return 1;
        case AT_MAXIMUM_STEP: *value = x->given.maximum_step; return 1;
        case AT_MAXIMUM_STEPS: *value = x->given.maximum_steps; return 1;
        case AT_INPUT: *value = s->drive.value[v->index]; return 1;
        case AT_DAE: *value = x->dae; return 1;
        default: return 0;
    }
}

/* Where the start value is kept. */
static double *start_place(const Instance *x, int j) {
    const System *s = x->solver.system;
    if (j < s->nq) return &x->q0[j];
    return j < system_states(s) ? &x->v0[j - s->nq] : &x->joint0[j - system_states(s)];
}

double instance_setting(const Instance *x, const Variable *v) {
    double value = 0;
    if (v->role == ROLE_START) return *start_place(x, v->state);
    (void)instance_was_set(x, v, &value);
    return value;
}

int instance_turned(const Instance *x) {
    const System *s = x->solver.system;
    if (s->contacts + s->frictions + s->switches + s->prescribed_count == 0) return 0;
    for (int k = 0; k < s->inputs; k++)
        if (x->solver.drive.value[k] != x->expected[k]) return 1;
    return 0;
}

void instance_turn(Instance *x) {
    Drive *drive = &x->solver.drive;
    drive->turned = instance_turned(x);
    drive->jumped = drive->turned && PRESCRIBED != NULL && PRESCRIBED->jumped(x);
}

void instance_inputs_changed(Instance *x) {
    solver_inputs_changed(&x->solver);
    if (ERROR_BARS != NULL) ERROR_BARS->inputs_changed(x);
}

/* The first setting of an input after a step replaces its polynomial, whatever is set first. */
static void renew_input(Instance *x, int k) {
    if (x->set[k]) return;
    x->set[k] = 1;
    x->solver.drive.first[k] = x->solver.drive.second[k] = 0;
}

static void set_input(Instance *x, int k, double value) {
    instance_unfollow(x);
    Drive *drive = &x->solver.drive;
    const int same = drive->value[k] == value && drive->first[k] == 0 && drive->second[k] == 0;
    renew_input(x, k);
    drive->value[k] = value;
    if (same) return;
    x->version += 1;
    if (x->started) instance_inputs_changed(x);
}

/* The start depends on inputs, too. */
static void set_input_or_start(Instance *x, int k, double value) {
    set_input(x, k, value);
    if (x->running) return;
    x->started = 0;
    x->version += 1;
}

void instance_set(Instance *x, const Variable *v, double value) {
    instance_unfollow(x);
    if (v->place == AT_LAMBDA || v->place == AT_DAE) { /* of an importer that solves for it */
        ALGEBRAIC->set(x, v, value);
        return;
    }
    if (v->place == AT_INPUT) {
        set_input_or_start(x, v->index, value);
        return;
    }
    x->started = 0;
    x->version += 1;
    if (v->role == ROLE_START) {
        *start_place(x, v->state) = value;
        return;
    }
    switch (v->place) {
        case AT_PARAMETER: x->solver.p[v->index] = value; break;
        case AT_METHOD: x->given.method = (int)value; break;
        case AT_TOLERANCE: x->given.tolerance = value; break;
        case AT_STEP: x->given.step = value; break;
        case AT_MAXIMUM_STEP: x->given.maximum_step = value; break;
        case AT_MAXIMUM_STEPS: x->given.maximum_steps = value; break;
        default: break;
    }
}

void instance_set_input_derivative(Instance *x, const Variable *v, int order, double value) {
    instance_unfollow(x);
    Drive *drive = &x->solver.drive;
    int k = v->index;
    const int place = PRESCRIBED == NULL ? -1 : PRESCRIBED->order(x, k);
    if (place >= 0 && place + order <= 2) { /* that derivative is an input itself */
        set_input_or_start(x, k + order, value);
        return;
    }
    if (place >= 0) { /* der(u,2) goes on by those beyond it */
        k += 2 - place;
        order -= 2 - place;
    }
    renew_input(x, k);
    double *where = order == 1 ? &drive->first[k] : &drive->second[k];
    if (*where == value) return;
    *where = value;
    x->version += 1;
    if (x->started) instance_inputs_changed(x);
}
