/* stiffness.h -- the method `auto`: dop853, and radau where stiffness holds dop853 back. */
#ifndef LAGFMU_STIFFNESS_H
#define LAGFMU_STIFFNESS_H

#include "integrator.h"
#include "linkage.h"
#include "saved.h"

enum {
    STIFFNESS_MOST_FAILURES = 8, /* times that the stiff steps asked for are made four times as many */
    STIFFNESS_MOST_RETRIES = 20  /* times that the steps before a retry are made twice as many */
};

/* What the choice remembers, as in saved.h; all zero at the start. */
#define CHOICE_NUMBERS(N)                                                                          \
    N(int, implicit, FLAG, "stiffness mode")    /* 1: radau is at work */                         \
    N(int, turn, FLAG, "stiffness turn")        /* 1: the other method takes over before the next step */ \
    N(int, unseen, COUNT, "stiffness memory")   /* dop853's steps since one was judged */          \
    N(int, stiff, COUNT, "stiffness memory")    /* of them, its stiff steps so far; ... */         \
    N(int, other, COUNT, "stiffness memory")    /* ... others in a row */                          \
    N(int, taken, COUNT, "stiffness memory")    /* radau's steps; ... */                          \
    N(int, brief, COUNT, "stiffness memory")    /* ... those in a row that did not pay */          \
    N(int, failures, COUNT, "stiffness memory") /* how often in a row radau did not pay */        \
    N(int, retries, COUNT, "stiffness memory")  /* how often dop853 was tried again */             \
    N(double, longest, LIMIT, "stiffness memory") /* [s] the longest of dop853's stiff steps */    \
    N(double, span, LIMIT, "stiffness memory")  /* [s] covered by radau's steps */                \
    N(double, time, FINITE, "time of stiffness") /* [s] when radau first took over, ... */        \
    N(double, product, LIMIT, "h rho")          /* ... h rho then (0: it never did), ... */        \
    N(double, ratio, LIMIT, "rho / sigma")      /* ... and rho / sigma (0: the motion's own rate was not known) */

typedef struct {
    CHOICE_NUMBERS(SAVED_MEMBER)
} Choice;

/* 1 if the step that dop853 has just taken is to be judged: one in three, each from a stiff one on. */
SHARED int stiffness_due(Choice *c);

/* Of y = (q, v): magnitudes of the coordinates (nq), and of what each speed moves (nv). */
typedef struct {
    int nq, nv;
    const double *size, *span;
} Magnitudes;

/* Judges the step that dop853 has just taken; f at its end is known. */
SHARED void stiffness_explicit_step(Choice *c, const Integrator *i, Magnitudes of);

/* Judges the step that radau has just taken. */
SHARED void stiffness_implicit_step(Choice *c, const Integrator *i);

/* dop853 comes back: at an event, or because radau did not pay, or failed. */
SHARED void stiffness_explicit(Choice *c, int paid);

/* 1 if the other method takes over now. */
SHARED int stiffness_turn(Choice *c);

/* What there is to say when radau takes over for the first time. */
SHARED void stiffness_message(const Choice *c, char *text, size_t size);

#endif
