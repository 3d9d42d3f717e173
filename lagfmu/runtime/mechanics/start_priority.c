/* start_priority.c -- which start values move first onto the constraints.
 *
 *   (W M W) dq = G_free^T mu ,  G_free dq = c
 *
 * with the coordinates of a stage free and the others held.  W (diagonal) makes the priorities of a stage so
 * unlike in mass that of two which could move the lower one does, and the higher one least: the limit of
 * least squares with unequal weights (Golub & Van Loan, Matrix Computations, sect. 12.1.5).  M couples none of
 * unlike priority: inertia would throw the light one by 1/W; and none that no row holds: these stay. */
#include "start_priority.h"

#include "thresholds.h"

static const double LITTLE_EASE = 0x1p-5; /* ... and where there is no solution for extreme masses */

void priority_moves(const System *s, const Priority *coordinates, Priority *moves) {
    for (int i = 0; i < s->nv; i++) moves[i] = s->kinematics != NULL ? OMITTED : coordinates[i];
    for (int e = 0; e < s->rates; e++) {
        Priority *highest = &moves[s->rate_column[e]];
        if (coordinates[s->rate_row[e]] > *highest) *highest = coordinates[s->rate_row[e]];
    }
}

int priority_stage(const System *s, const Priority *priority, int stage) {
    for (; stage < PRIORITIES; stage++)
        for (int j = 0; j < s->nv; j++)
            if ((int)priority[j] == stage) return stage;
    return PRIORITIES;
}

int priority_rows(const System *s, const Priority *priority, int stage, const int *rows, int *own) {
    int all = 1;
    for (int k = 0; k < s->m; k++) {
        own[k] = 0;
        for (int e = s->row_start[k]; e < s->row_start[k + 1] && rows[k]; e++)
            own[k] |= (int)priority[s->entry_column[e]] <= stage;
        all &= own[k] == rows[k];
    }
    return all;
}

static double weight(Priority priority, int stage, double ease) {
    if (priority == SET || (int)priority >= stage) return 1;
    return priority == OMITTED ? ease * ease : ease;
}

Status priority_nearest(Mechanism *b, const Priority *priority, int stage, const int *own,
                          const double *c) {
    const System *s = b->system;
    const double firmly = b->linear.dense != NULL ? PRIORITY_EASE : LITTLE_EASE;
    const double ease = stage < PRIORITIES ? firmly : PRIORITY_GENTLY;
    double *held = b->dq;
    for (int j = 0; j < s->nv; j++) held[j] = 0;
    for (int e = 0; e < s->entries; e++)
        if (own[s->entry_row[e]] && b->G[e] != 0) held[s->entry_column[e]] = 1;
    for (int e = 0; e < s->masses; e++) {
        const int i = s->mass_row[e], j = s->mass_column[e];
        const int stays = (int)priority[i] > stage || (int)priority[j] > stage;
        const int apart = priority[i] != priority[j] || held[i] != held[j];
        if (i != j && (stays || apart)) b->M[e] = 0;
        if (!stays) b->M[e] *= weight(priority[i], stage, ease) * weight(priority[j], stage, ease);
    }
    for (int e = 0; e < s->entries; e++)
        if ((int)priority[s->entry_column[e]] > stage) b->G[e] = 0;
    const Status status = linear_project(&b->linear, b->M, b->G, own, c, b->dq);
    for (int j = 0; j < s->nv; j++)
        if ((int)priority[j] > stage) b->dq[j] = 0; /* where M is singular, rounding may be left */
    return status;
}
