/* instance_step.c -- one communication step, and what there is to tell of it. */
#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "digits.h"
#include "optional.h"
#include "prescribed.h"
#include "segment.h"

/* Once for each: a table is looked up beyond its ends. */
static void warn_of_tables(Instance *x) {
    Solver *s = &x->solver;
    const System *system = s->system;
    const Instant at = segment_instant(s, s->state.now.t);
    system->lookups(at.t, s->state.q, s->state.v, at.u, at.p, x->places);
    for (int i = 0; i < system->lookup_count && i < 30; i++) {
        const double first = system->lookup_first[i], last = system->lookup_last[i];
        const int told = 2 << i;
        if ((x->warned & told) || (x->places[i] >= first && x->places[i] <= last)) continue;
        x->warned |= told;
        (void)snprintf(x->note, sizeof x->note,
                       "table %s is looked up at %s, outside of its points from %s to %s: it goes on "
                       "as a straight line",
                       system->lookup_names[i], digits(x->places[i]).text, digits(first).text,
                       digits(last).text);
        x->tell(x->context, NOTE_WARNING, x->note);
    }
}

/* The inputs go on to the time t by their derivatives, where they stay until they are set again. */
static void move_inputs(Instance *x, double t) {
    const System *s = x->solver.system;
    Drive *drive = &x->solver.drive;
    if (s->inputs == 0) return;
    drive_at(s, drive, t, x->expected);
    for (int k = 0; k < s->inputs; k++) {
        drive->value[k] = x->expected[k];
        drive->first[k] += (t - drive->since) * drive->second[k];
    }
    drive->since = t;
}

/* Of `auto`: why radau took over, the first time; then each change that a communication step ends with. */
static void tell_of_method(Instance *x, double product, int implicit) {
    const Choice *c = &x->solver.state.now.choice;
    if (product == 0 && c->product > 0) {
        stiffness_message(c, x->note, sizeof x->note);
        x->tell(x->context, NOTE_EVENT, x->note);
        implicit = 1;
    }
    if (implicit == c->implicit) return;
    (void)snprintf(x->note, sizeof x->note, "at t = %s s: going on with %s again",
                   digits(x->solver.state.now.t).text, c->implicit ? "radau" : "dop853");
    x->tell(x->context, NOTE_EVENT, x->note);
}

/* Of a step that began with nothing to integrate, or not: whether that has changed. */
static void tell_of_freedom(Instance *x, double begun, int led) {
    const Solver *s = &x->solver;
    const char *name = OPTIONAL.names[s->settings.method];
    if (led == s->state.now.led) return;
    if (led)
        (void)snprintf(x->note, sizeof x->note,
                       "at t = %s s: the constraints alone do not lead on: going on with %s",
                       digits(s->state.now.t).text, name);
    else
        (void)snprintf(x->note, sizeof x->note,
                       "from t = %s s on: constraints and prescribed motions leave no freedom, so that nothing is "
                       "integrated, and %s is not needed: each state is found from the constraints",
                       digits(begun).text, name);
    x->tell(x->context, NOTE_EVENT, x->note);
}

/* ------------------------------------------------------------------ what the importer does within a step */

/* Inputs at a time of the step, for which it is asked once; those that it gave last where it may not be asked. */
static void supply(void *caller, double t, double *u) {
    Instance *x = caller;
    Between *between = &x->between;
    if (t != between->asked && t >= between->finished && t <= between->end && !between->paused) {
        between->asked = t;
        between->ask(x->context, t);
    }
    for (int k = 0; k < x->solver.system->inputs; k++)
        if (between->supplied[k]) u[k] = between->value[k];
}

/* It looks at the state, which is final; when the step is to end. */
static double let_look(Instance *x, double end) {
    Between *between = &x->between;
    x->version += 1;
    between->finished = x->solver.state.now.t;
    between->paused = 1;
    const double sooner = between->look(x->context, between->finished, end);
    between->paused = 0;
    return fmin(fmax(sooner, between->finished), end);
}

static void pause_step(void *caller, double *t_end) {
    Instance *x = caller;
    *t_end = let_look(x, *t_end);
    x->version += 1;
}

static void open_step(Instance *x, double t_end) {
    Between *between = &x->between;
    Solver *s = &x->solver;
    if (between->look == NULL) return;
    between->finished = s->state.now.t;
    between->end = t_end;
    between->asked = NAN;
    s->caller.own = x;
    s->caller.pause = pause_step;
    if (!between->supplies) return;
    memcpy(between->value, s->drive.value, (size_t)s->system->inputs * sizeof *between->value);
    s->caller.supply = supply;
}

/* The inputs that it supplied stay as they were at last. */
static void close_step(Instance *x) {
    Solver *s = &x->solver;
    s->caller.pause = NULL;
    if (s->caller.supply == NULL) return;
    s->caller.supply(x, s->state.now.t, s->u);
    s->caller.supply = NULL;
    for (int k = 0; k < s->system->inputs; k++) {
        if (!x->between.supplied[k]) continue;
        s->drive.value[k] = x->expected[k] = x->between.value[k];
        s->drive.first[k] = s->drive.second[k] = 0;
    }
}

/* ------------------------------------------------------------------ a step */

static void prepare_step(Instance *x, double t_end) {
    instance_unfollow(x);
    instance_save(x, x->backup);
    if (PRESCRIBED != NULL) PRESCRIBED->begin_step(x);
    instance_turn(x);
    memcpy(x->expected, x->solver.drive.value, (size_t)x->solver.system->inputs * sizeof *x->expected);
    instance_count_events(x);
    if (ERROR_BARS != NULL) ERROR_BARS->begin_step(x, t_end);
    x->version += 1;
    x->solver.passed.text[0] = '\0';
    open_step(x, t_end);
}

/* From where it ends, whatever t_end was. */
static void finish_step(Instance *x) {
    Solver *s = &x->solver;
    const double t = s->state.now.t;
    if (ERROR_BARS != NULL) ERROR_BARS->follow(x, t);
    move_inputs(x, t);
    close_step(x);
    memset(x->set, 0, (size_t)s->system->inputs * sizeof *x->set);
    if (s->passed.text[0] != '\0') x->tell(x->context, NOTE_WARNING, s->passed.text);
    if (s->system->lookup_count > 0) warn_of_tables(x);
    instance_tell_events(x);
}

/* What is read at the end is what the error bars take in, and the importer may look at. */
static void show_end(Instance *x) {
    if (ERROR_BARS != NULL) ERROR_BARS->widen(x);
    if (x->between.look != NULL) (void)let_look(x, x->solver.state.now.t);
}

Status instance_step(Instance *x, double t_end) {
    Solver *s = &x->solver;
    x->ticking = 0;
    if (solver_pass(s, t_end)) {
        x->version += 1;
        if (ERROR_BARS != NULL) ERROR_BARS->follow(x, t_end);
        show_end(x);
        return OK;
    }
    const double begun = s->state.now.t, product = s->state.now.choice.product;
    const int implicit = s->state.now.choice.implicit, led = s->state.now.led;
    prepare_step(x, t_end);
    if (solver_advance(s, t_end) != OK) {
        s->caller.supply = NULL;
        s->caller.pause = NULL;
        instance_restore(x, x->backup);
        return FAILED;
    }
    finish_step(x);
    tell_of_method(x, product, implicit);
    tell_of_freedom(x, begun, led);
    show_end(x);
    return OK;
}
