/* instance_events.c -- events of contacts and frictions: what there is to tell of them, and those that an importer of
 * co-simulation meets itself, between the limit from the left and that from the right. */
#include "instance.h"

#include <stdio.h>
#include <string.h>

#include "digits.h"
#include "prescribed.h"

/* What contact, or friction, i has done since they were counted, and when it did so last. */
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

static void report_all(Instance *x) {
    const System *s = x->solver.system;
    for (int c = 0; c < s->contacts; c++) report_both(x, CLOSING, DEPARTURE, c);
    for (int i = 0; i < s->frictions; i++) report_both(x, SLIPPING, STICKING, i);
}

void instance_tell_events(Instance *x) {
    int closed = 0;
    if (!x->quiet) report_all(x);
    for (int c = 0; c < x->solver.system->contacts; c++)
        closed |= x->solver.state.latest[CLOSING].count[c] != x->before[CLOSING][c];
    if (closed) instance_warn_of_shares(x);
    if (DERIVATIVES != NULL) DERIVATIVES->tell(x);
}

void instance_count_events(Instance *x) {
    for (int k = 0; k < EVENT_KINDS; k++) {
        const int count = event_count_of(x->solver.system, (EventKind)k);
        memcpy(x->before[k], x->solver.state.latest[k].count, (size_t)count * sizeof(Count));
    }
}

int instance_event_happened(const Instance *x) {
    int any = 0;
    for (int k = 0; k < EVENT_KINDS; k++)
        for (int i = 0; i < event_count_of(x->solver.system, (EventKind)k); i++)
            any |= x->solver.state.latest[k].count[i] != x->before[k][i];
    return any;
}

/* `act` of the solver, at the instant of now.  FAILED: everything is as it was before. */
static Status at_once(Instance *x, Status (*act)(Solver *)) {
    instance_save(x, x->backup);
    instance_count_events(x);
    x->version += 1;
    if (act(&x->solver) != OK) {
        instance_restore(x, x->backup);
        return FAILED;
    }
    x->ticking = instance_event_happened(x);
    instance_tell_events(x);
    return OK;
}

Status instance_meet(Instance *x) {
    x->ticking = 0;
    return x->solver.state.now.pending ? at_once(x, solver_meet) : OK;
}

Status instance_settle(Instance *x, int *again) {
    const System *s = x->solver.system;
    *again = x->ticking = 0;
    if (s->estimated_count > 0 || ERROR_BARS != NULL) return OK; /* the next step begins with it */
    if (x->solver.state.now.pending || !instance_turned(x)) return OK;
    instance_unfollow(x);
    if (PRESCRIBED != NULL) PRESCRIBED->begin_step(x);
    instance_turn(x);
    const Status status = at_once(x, solver_follow);
    x->solver.drive.turned = x->solver.drive.jumped = 0;
    if (status != OK) return FAILED;
    memcpy(x->expected, x->solver.drive.value, (size_t)s->inputs * sizeof *x->expected);
    *again = x->ticking;
    return OK;
}

int instance_ticks(const Instance *x, int clock) {
    const int contacts = x->solver.system->contacts, i = clock < contacts ? clock : clock - contacts;
    const Latest *first = &x->solver.state.latest[clock < contacts ? DEPARTURE : SLIPPING], *latest = first;
    if (!x->ticking) return 0;
    for (; latest < first + 2; latest++)
        if (latest->count[i] > 0 && latest->time[i] == x->solver.state.now.t) return 1;
    return 0;
}
