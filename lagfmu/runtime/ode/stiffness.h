/* stiffness.h -- the method `auto`: dop853, and radau5 where stiffness holds dop853 back. */
#ifndef LAGFMU_STIFFNESS_H
#define LAGFMU_STIFFNESS_H

#include "integrator.h"
#include "linkage.h"

enum {
    STIFFNESS_MOST_FAILURES = 8, /* times that the stiff steps asked for are made four times as many */
    STIFFNESS_MOST_RETRIES = 20  /* times that the steps before a retry are made twice as many */
};

/* What the choice remembers; all zero at the start. */
typedef struct {
    int implicit;     /* 1: radau5 is at work */
    int turn;         /* 1: the other method takes over before the next step */
    int unseen;       /* dop853's steps since one was judged */
    int stiff, other; /* of them, its stiff steps so far; others in a row */
    int taken, brief; /* radau5's steps; those in a row that did not pay */
    int failures;     /* how often in a row radau5 did not pay */
    int retries;      /* how often dop853 was tried again */
    double longest;   /* [s] the longest of dop853's stiff steps */
    double span;      /* [s] covered by radau5's steps */
    double time;      /* [s] when radau5 first took over, ... */
    double product;   /* ... h rho then (0: it never did), ... */
    double ratio;     /* ... and rho / sigma (0: the motion's own rate was not known) */
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

/* Judges the step that radau5 has just taken. */
SHARED void stiffness_implicit_step(Choice *c, const Integrator *i);

/* dop853 comes back: at an event, or because radau5 did not pay, or failed. */
SHARED void stiffness_explicit(Choice *c, int paid);

/* 1 if the other method takes over now. */
SHARED int stiffness_turn(Choice *c);

/* What there is to say when radau5 takes over for the first time. */
SHARED void stiffness_message(const Choice *c, char *text, size_t size);

#endif
