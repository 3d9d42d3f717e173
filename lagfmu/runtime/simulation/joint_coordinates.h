/* joint_coordinates.h -- joint coordinates h(q, t) with the rates H v + h_t, and what moves them where they are asked
 * to be. */
#ifndef LAGFMU_JOINT_COORDINATES_H
#define LAGFMU_JOINT_COORDINATES_H

#include "linkage.h"
#include "solver.h"

struct JointSearch {
    Instant at;
    int of_rates;                 /* 1: rates are looked for; 0: values */
    int least;                    /* the priority from which joint coordinates are held */
    int gently;                   /* 1: others stay where those, and the constraints, leave them free */
    int *order;                   /* (joint_count) joint coordinates by falling priority */
    double *asked;                /* (system_starts()) */
    Priority *priority, *held;    /* (system_starts()); (nv) SET where a speed is held, otherwise OMITTED */
    double *q, *v;                /* (nq), (nv) what is looked for */
    double *trial;                /* (nq) */
    double *c, *d;                /* (m), (nv) of joint_step() */
    double *value, *drift;        /* (joint_count) h, h_t */
    double *miss, *size;          /* (joint_count) what is missing, and the size of its terms */
    double *H;                    /* (joint_rates) */
    double *A, *share, *y;        /* (joint_count (joint_count + 1) / 2), (joint_count), (nv) of joint_step() */
    double *part, *zero;          /* (nv), (nv + m) scratch, zeros */
    double *own, *other;          /* (output_count) */
};

SHARED void joint_layout(Solver *s, Arena *scratch);

/* The place among start values of the value of joint coordinate k, or of its rate. */
static inline int joint_place(const Solver *s, int k, int of_rates) {
    return system_states(s->system) + 2 * k + of_rates;
}

/* Who said the value, or the rate, that is looked for. */
static inline Priority joint_priority(const Solver *s, int k) {
    return s->part.joints->priority[joint_place(s, k, s->part.joints->of_rates)];
}

/* H v of joint coordinate k. */
SHARED double joint_along(const Solver *s, int k, const double *v);

/* h, h_t and H at q. */
SHARED void joint_measure(Solver *s, const double *q);

/* miss and size of the values, or of the rates with v (nv), where they were measured last; the largest miss of those
 * that are held, relative to its size. */
SHARED double joint_missing(Solver *s, const double *v);

/* x->order, by the priorities of what is looked for. */
SHARED void joint_arrange(Solver *s);

/* d (nv) with G d = c on the rows (m) and H d = miss, as nearly as can be, where nothing that is held moves; by M and
 * G at the state that was evaluated last, which are lost. */
SHARED Status joint_step(Solver *s, const int *rows);

#endif
