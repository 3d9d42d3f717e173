/* instance_step.c -- one communication step, and what there is to tell of it. */
#include "instance.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "digits.h"
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

/* What contact, or friction, i has done in this step, and when it did so last. */
static void report(Instance *x, EventKind kind, int i) {
    static const char *const SORT[] = {"contact", "contact", "friction", "friction"};
    static const char *const DONE[] = {"opened", "closed", "began to slip", "began to stick"};
    const Solver *s = &x->solver;
    const Latest *latest = &s->state.latest[kind];
    const Count again = latest->count[i] - x->before[kind][i];
    const int struck = kind == CLOSING && s->state.impulse[i] > 0;
    const char *name = kind <= CLOSING ? s->system->rows[s->system->contact[i]].name : s->system->friction[i].name;
    const char *stays = struck && s->state.closed[i] ? ", and stays closed" : "";
    char impulse[80] = "", more[32] = "";
    if (again == 0) return;
    if (struck)
        (void)snprintf(impulse, sizeof impulse, ", impulse %s (of its lambda times s)",
                       digits(s->state.impulse[i]).text);
    if (again > 1) (void)snprintf(more, sizeof more, ", the latest of %.0f", (double)again);
    (void)snprintf(x->note, sizeof x->note, "%s %s %s at t = %s s%s%s%s", SORT[kind], name,
                   struck ? "was struck" : DONE[kind], digits(latest->time[i]).text, impulse, more, stays);
    x->tell(x->context, NOTE_EVENT, x->note);
}

/* Of two kinds that take turns, the one that was first. */
static void report_both(Instance *x, EventKind one, EventKind other, int i) {
    const Latest *latest = x->solver.state.latest;
    const int turned = latest[other].time[i] < latest[one].time[i];
    report(x, turned ? other : one, i);
    report(x, turned ? one : other, i);
}

static void report_events(Instance *x) {
    const System *s = x->solver.system;
    if (x->quiet) return;
    for (int c = 0; c < s->contacts; c++) report_both(x, CLOSING, DEPARTURE, c);
    for (int i = 0; i < s->frictions; i++) report_both(x, SLIPPING, STICKING, i);
}

static int has_closed(const Instance *x) {
    int any = 0;
    for (int c = 0; c < x->solver.system->contacts; c++)
        any |= x->solver.state.latest[CLOSING].count[c] != x->before[CLOSING][c];
    return any;
}

static void remember_counts(Instance *x) {
    for (int k = 0; k < EVENT_KINDS; k++) {
        const int count = event_count_of(x->solver.system, (EventKind)k);
        memcpy(x->before[k], x->solver.state.latest[k].count, (size_t)count * sizeof(Count));
    }
}

/* Of `auto`: why radau5 took over, the first time; then each change that a communication step ends with. */
static void tell_of_method(Instance *x, double product, int implicit) {
    const Choice *c = &x->solver.state.now.choice;
    if (product == 0 && c->product > 0) {
        stiffness_message(c, x->note, sizeof x->note);
        x->tell(x->context, NOTE_EVENT, x->note);
        implicit = 1;
    }
    if (implicit == c->implicit) return;
    (void)snprintf(x->note, sizeof x->note, "at t = %s s: going on with %s again",
                   digits(x->solver.state.now.t).text, c->implicit ? "radau5" : "dop853");
    x->tell(x->context, NOTE_EVENT, x->note);
}

Status instance_step(Instance *x, double t_end) {
    Solver *s = &x->solver;
    if (solver_pass(s, t_end)) {
        x->observed = x->evaluated = 0;
        if (ERROR_BARS != NULL) ERROR_BARS->follow(x, t_end);
        if (ERROR_BARS != NULL) ERROR_BARS->widen(x);
        return OK;
    }
    instance_unfollow(x);
    instance_save(x, x->backup);
    if (PRESCRIBED != NULL) PRESCRIBED->begin_step(x);
    s->drive.turned = instance_turned(x);
    memcpy(x->expected, s->drive.value, (size_t)s->system->inputs * sizeof *x->expected);
    if (s->system->contacts + s->system->frictions > 0) remember_counts(x);
    if (ERROR_BARS != NULL) ERROR_BARS->begin_step(x, t_end);
    x->observed = x->evaluated = 0;
    const double product = s->state.now.choice.product;
    const int implicit = s->state.now.choice.implicit;
    s->passed.text[0] = '\0';
    if (solver_advance(s, t_end) != OK) {
        instance_restore(x, x->backup);
        return FAILED;
    }
    if (ERROR_BARS != NULL) ERROR_BARS->follow(x, t_end);
    move_inputs(x, t_end);
    memset(x->set, 0, (size_t)s->system->inputs * sizeof *x->set);
    if (s->passed.text[0] != '\0') x->tell(x->context, NOTE_WARNING, s->passed.text);
    if (s->system->lookup_count > 0) warn_of_tables(x);
    if (s->system->contacts + s->system->frictions > 0) report_events(x);
    if (has_closed(x)) instance_warn_of_shares(x);
    tell_of_method(x, product, implicit);
    if (ERROR_BARS != NULL) ERROR_BARS->widen(x);
    return OK;
}
