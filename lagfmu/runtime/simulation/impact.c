/* impact.c -- impacts: all contacts that are struck at one instant are solved together (docs/impacts.md).
 *
 *   M (v+ - v-) = G^T Lambda ,   s = G v - nu
 *   0 <= Lambda_k  _|_  s_k+ + e_k s_k- >= 0    contacts that touch with s_k- <= 0
 *   s_k+ = 0                                    rows that always act, or act with such a contact
 *
 * Newton's law of restitution with complementarity (Moreau 1988; Pfeiffer & Glocker, Multibody Dynamics with
 * Unilateral Contacts, 1996, ch. 8; Glocker, Set-Valued Force Laws, 2001).  With 0 <= e <= 1 and s- <= 0 the
 * energy in the contacts' own frame does not rise,
 * Lambda^T (s+ + s-) / 2 = sum (1 - e_k) Lambda_k s_k- / 2 <= 0. */
#include "impact.h"

#include <math.h>
#include <string.h>

#include "contacts.h"
#include "digits.h"
#include "optional.h"

enum { IMPACT_ROUNDS = 1000 }; /* at one instant, after which the rest is one plastic impact */
static const double IMPACT_ROUNDING = 1e-14; /* of the terms of a speed: one that is none; rest does not jam */

/* What an impact starts from, and its workspace.  Rows are numbered as in the system, contacts by their
 * position among the contacts, `k` of them entering. */
typedef struct {
    Solver *s;
    Mechanism *b;
    double *slip, *e, *zero, *right; /* (m) s-, e; 0; right-hand sides */
    double *x;                       /* (nv) */
    double *A, *c, *z, *w, *work;    /* of complementarity.h */
    int k, *contact, *row, *holding; /* (contacts) those that enter, their rows; 1: rows that act with it do */
    int *active;                     /* (m) */
    int *iwork;
} Struck;

/* Rows that act with both signs: those that always do, and those of the contacts in `holding`. */
static void set_base(Struck *x) {
    const System *system = x->s->system;
    system_active(system, x->holding, x->active);
    for (int c = 0; c < system->contacts; c++) x->active[system->contact[c]] = 0;
}

static int acts_with(const System *system, int contact) {
    for (int j = 0; j < system->m; j++)
        if (system->rows[j].while_closed == system->contact[contact] && system->rows[j].friction == 0)
            return 1;
    return 0;
}

Status impact_compliance(Mechanism *b, int count, const int *rows, double *force, const double *zero,
                         Impulse scratch, double *A) {
    for (int i = 0; i < count; i++) {
        memset(force, 0, (size_t)b->system->nv * sizeof *force);
        mechanism_push(b, rows[i], 1, force);
        if (linear_solve(&b->linear, force, zero, scratch.dv, scratch.Lambda) != OK) return FAILED;
        for (int j = 0; j < count; j++) A[j * count + i] = mechanism_row(b, rows[j], scratch.dv);
    }
    for (int i = 0; i < count; i++)
        for (int j = 0; j < i; j++) A[i * count + j] = A[j * count + i] = (A[i * count + j] + A[j * count + i]) / 2;
    return OK;
}

/* A (k, k) and c (k): s+ + e s- = A Lambda + c on the contacts, the base rows taken care of. */
static Status reduce_impact(Struck *x, const Impulse *scratch) {
    const System *system = x->s->system;
    Mechanism *b = x->b;
    if (linear_factor(&b->linear, b->M, b->G, x->active) != OK) return FAILED;
    for (int j = 0; j < system->m; j++) x->right[j] = -x->slip[j];
    if (linear_nearest(&b->linear, NULL, x->right, scratch->dv, scratch->Lambda) != OK) return FAILED;
    for (int i = 0; i < x->k; i++) {
        const int row = x->row[i];
        x->c[i] = (1 + x->e[row]) * x->slip[row] + mechanism_row(b, row, scratch->dv);
    }
    return impact_compliance(b, x->k, x->row, x->x, x->zero, *scratch, x->A);
}

static int rebounds(const Struck *x) {
    for (int j = 0; j < x->s->system->m; j++)
        if (x->e[j] > 0) return 1;
    return 0;
}

static Status no_velocities(Struck *x, double time) {
    const char *comma = "";
    Digits t = digits(time);
    fail(&x->s->why, "no velocities after the impact at t = %s s satisfy the contacts ", t.text);
    for (int i = 0; i < x->k; i++) {
        why_append(&x->s->why, "%s'%s'", comma, x->s->system->rows[x->row[i]].name);
        comma = ", ";
    }
    why_append(&x->s->why, " together: they are driven against each other");
    return FAILED;
}

/* Velocities from the rows that were found, solved once more together.  Lambda of dependent rows is that
 * of least norm, if that pushes; else the one that was found. */
static Status finish_impact(Struck *x, const Impulse *found) {
    const System *system = x->s->system;
    Mechanism *b = x->b;
    for (int j = 0; j < system->m; j++) x->right[j] = -x->slip[j];
    for (int pass = 0; pass < 2; pass++) {
        double most = 0, least = 0;
        set_base(x);
        for (int i = 0; i < x->k; i++) {
            const int row = x->row[i];
            x->active[row] = pass == 0 ? x->w[i] == 0 : x->z[i] > 0;
            x->right[row] = -(1 + x->e[row]) * x->slip[row];
        }
        if (linear_factor(&b->linear, b->M, b->G, x->active) != OK) return FAILED;
        if (linear_nearest(&b->linear, NULL, x->right, found->dv, found->Lambda) != OK) return FAILED;
        for (int j = 0; j < system->m; j++) most = fmax(most, fabs(found->Lambda[j]));
        for (int i = 0; i < x->k; i++) least = fmin(least, found->Lambda[x->row[i]]);
        if (least >= -IMPACT_PULL * most) break;
    }
    return OK;
}

/* The law.  A row that acts with a contact does so unless the others make the contact depart. */
static Status newton_impact(Struck *x, double time, const Impulse *found) {
    const System *system = x->s->system;
    memset(x->holding, 0, (size_t)system->contacts * sizeof *x->holding);
    for (int i = 0; i < x->k; i++) x->holding[x->contact[i]] = 1;
    for (int departed = 1; departed;) {
        set_base(x);
        if (reduce_impact(x, found) != OK) return FAILED;
        if (!complementarity_solve(x->k, x->A, x->c, x->z, x->w, x->work, x->iwork)) {
            if (!rebounds(x)) return no_velocities(x, time);
            memset(x->e, 0, (size_t)system->m * sizeof *x->e);
            continue; /* rows that act with a contact leave no room to rebound */
        }
        departed = 0;
        for (int i = 0; i < x->k; i++) {
            const int c = x->contact[i];
            if (!(x->w[i] > 0) || !x->holding[c]) continue;
            x->holding[c] = 0;
            departed |= acts_with(system, c);
        }
    }
    return finish_impact(x, found);
}

/* Energy gained in the contacts' own frame [J], Lambda^T (s+ + s-) / 2, on the way from the plastic
 * impact (part = 0) to Newton's (part = 1). */
static double gain(const Struck *x, const Impulse *plastic, const Impulse *newton_impact, double part) {
    double sum = 0;
    for (int j = 0; j < x->s->system->m; j++) {
        const double from = mechanism_row(x->b, j, plastic->dv);
        const double to = mechanism_row(x->b, j, newton_impact->dv);
        const double Lambda = plastic->Lambda[j] + part * (newton_impact->Lambda[j] - plastic->Lambda[j]);
        if (Lambda != 0) sum += Lambda * (2 * x->slip[j] + from + part * (to - from)) / 2;
    }
    return sum;
}

/* Between the plastic impact, which never raises the energy, and Newton's, which does: the one that keeps it.
 * The energy is quadratic on the way. */
static void blend(const Struck *x, const Impulse *found, const Impulse *plastic) {
    const System *system = x->s->system;
    const double gained = gain(x, found, found, 1);
    const double lost = -gain(x, plastic, found, 0);
    double part = 0;
    if (lost > 0) {
        const double slope = 4 * gain(x, plastic, found, 0.5) + 3 * lost - gained;
        const double bend = gained + lost - slope;
        const double root = sqrt(fmax(slope * slope + 4 * lost * bend, 0));
        part = slope < 0 ? (root - slope) / (2 * bend) : 2 * lost / (slope + root);
        part = fmin(fmax(part, 0), 1);
    }
    for (int j = 0; j < system->nv; j++)
        found->dv[j] = plastic->dv[j] + part * (found->dv[j] - plastic->dv[j]);
    for (int j = 0; j < system->m; j++)
        found->Lambda[j] = plastic->Lambda[j] + part * (found->Lambda[j] - plastic->Lambda[j]);
}

/* Where rows that act with a contact make Newton's law raise the energy. */
static Status bound(Struck *x, double time, const Impulse *found, const Impulse *plastic) {
    const System *system = x->s->system;
    int any = 0;
    for (int i = 0; i < x->k; i++) any |= acts_with(system, x->contact[i]);
    if (!any || !(gain(x, found, found, 1) > 0)) return OK;
    memset(x->e, 0, (size_t)system->m * sizeof *x->e);
    if (newton_impact(x, time, plastic) != OK) return FAILED;
    blend(x, found, plastic);
    return OK;
}

static void set_restitution(Struck *x, const int *dead) {
    const System *system = x->s->system;
    system->restitution(x->s->p, x->e);
    for (int c = 0; c < system->contacts; c++)
        if (dead == NULL || dead[c]) x->e[system->contact[c]] = 0;
}

/* The law without friction, and then with it where it can be found. */
static Status strike_together(Struck *x, Instant at, const double *q, const double *v, const int *entering,
                              const int *dead, const Impulse *found, const Impulse *plastic) {
    int done = 0;
    if (x->s->system->frictions > 0) {
        set_restitution(x, dead);
        if (OPTIONAL.friction->impact(x->s, at, q, v, entering, x->slip, x->e, *plastic, *found, &done) != OK)
            return FAILED;
    }
    if (done) {
        if (gain(x, found, found, 1) > 0) blend(x, found, plastic);
        return OK;
    }
    set_restitution(x, dead);
    return newton_impact(x, at.t, found) != OK ? FAILED : bound(x, at.t, found, plastic);
}

Status impact(Solver *s, Instant at, const double *q, double *v, const int *entering, const int *dead,
              double *Lambda) {
    const System *system = s->system;
    const int nv = system->nv, m = system->m, contacts = system->contacts;
    Struck x = {.s = s, .b = &s->stepped, .slip = s->part.contacts->impact, .contact = s->part.contacts->struck};
    x.e = x.slip + m;
    x.zero = x.e + m;
    x.right = x.zero + m;
    x.x = x.right + m;
    const Impulse found = {x.x + nv, Lambda}, soft = {found.dv + nv, found.dv + 2 * nv};
    x.A = soft.Lambda + m;
    x.c = x.A + contacts * contacts;
    x.z = x.c + contacts;
    x.w = x.z + contacts;
    x.work = x.w + contacts;
    x.row = x.contact + contacts;
    x.holding = x.row + contacts;
    x.active = x.holding + contacts;
    x.iwork = x.active + m;
    if (mechanism_evaluate(x.b, at, q, v) != OK) return FAILED;
    for (int c = 0; c < contacts; c++)
        if (entering[c]) {
            x.row[x.k] = system->contact[c];
            x.contact[x.k++] = c;
        }
    for (int j = 0; j < m; j++) {
        const double terms = mechanism_row_size(x.b, j, v) + fabs(x.b->nu[j]);
        x.slip[j] = mechanism_slip(x.b, j, v);
        if (fabs(x.slip[j]) <= IMPACT_ROUNDING * terms) x.slip[j] = 0;
        x.zero[j] = 0;
    }
    if (strike_together(&x, at, q, v, entering, dead, &found, &soft) != OK) return FAILED;
    s->state.now.lost -= gain(&x, &found, &found, 1);
    for (int j = 0; j < nv; j++) v[j] += found.dv[j];
    return OK;
}

/* Contacts that take part: approached or at rest; one that separates does not, and if it is driven back,
 * that is the next impact.  Returns whether any is approached. */
static int find_entering(const Solver *s, const double *v, const int *touching, const double *slow,
                         int plastic, int *entering) {
    const System *system = s->system;
    int any = 0;
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        const double speed = mechanism_slip(&s->stepped, k, v);
        entering[c] = touching[c] && (speed <= slow[k] || plastic);
        any |= touching[c] && speed < -slow[k];
    }
    return any;
}

Status impacts(Solver *s, Instant at, const double *q, double *v, const int *touching, const double *slow,
               const int *dead, int *struck) {
    const System *system = s->system;
    const int contacts = system->contacts;
    int *entering = s->part.contacts->struck + impact_ints(system->m, contacts) - contacts;
    double *Lambda = s->part.contacts->impact + impact_doubles(system->nv, system->m, contacts) - system->m;
    memset(struck, 0, (size_t)contacts * sizeof *struck);
    memset(s->part.contacts->push, 0, (size_t)contacts * sizeof *s->part.contacts->push);
    for (int round = 1; round <= IMPACT_ROUNDS; round++) {
        if (mechanism_evaluate(&s->stepped, at, q, v) != OK) return FAILED;
        if (!find_entering(s, v, touching, slow, round == IMPACT_ROUNDS, entering)) return OK;
        if (impact(s, at, q, v, entering, round == IMPACT_ROUNDS ? NULL : dead, Lambda) != OK) return FAILED;
        for (int c = 0; c < contacts; c++) {
            const double push = Lambda[system->contact[c]];
            if (!entering[c] || !(push > 0)) continue;
            s->part.contacts->push[c] += push;
            struck[c] = 1;
        }
    }
    return OK;
}

Status impact_check(Solver *s) {
    const System *system = s->system;
    double *e = s->part.contacts->impact;
    const char *and = "the start is refused: ";
    s->why.text[0] = 0;
    system->restitution(s->p, e);
    for (int c = 0; c < system->contacts; c++) {
        const int k = system->contact[c];
        if (e[k] >= 0 && e[k] <= 1) continue;
        Digits value = digits(e[k]);
        why_append(&s->why,
                   "%sthe coefficient of restitution of '%s' is %s, expected 0 (no rebound) to 1 (no "
                   "loss)",
                   and, system->rows[k].name, value.text);
        and = "; ";
    }
    return s->why.text[0] == 0 ? OK : FAILED;
}
