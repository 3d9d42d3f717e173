/* peaks.h -- the extremes of quantities over the motion so far, between communication points too. */
#ifndef LAGFMU_PEAKS_H
#define LAGFMU_PEAKS_H

#include "feature.h"
#include "instance.h"
#include "linkage.h"

/* What is kept of quantity k, in kept. */
typedef enum { PEAK_MAX, PEAK_MIN, PEAK_MAX_TIME, PEAK_MIN_TIME, PEAK_PARTS } PeakPart;

/* Where a record stands that is the latest point that has counted: whether it is one is not known before the motion
 * goes on.  At the start it is one. */
typedef enum { PEAK_SETTLED, PEAK_OPEN, PEAK_BEGUN } PeakStanding;

/* Doubles to be saved: the parts; their changes by each of `columns` (peak_changes.c) and the PeakStanding of largest
 * and smallest, if there are columns; the time [s] as far as all has counted. */
static inline int peaks_saved(int peaks, int columns) {
    return peaks > 0 ? (PEAK_PARTS * (1 + columns) + (columns > 0 ? 2 : 0)) * peaks + 1 : 0;
}

/* Where a record lies: at a given time; at the event of now, behind it or before; an extreme inside of the motion; one
 * more that is the same to the tolerance; where the motion has gone on from, or began. */
typedef enum { PEAK_GIVEN, PEAK_EVENT, PEAK_BEFORE, PEAK_INSIDE, PEAK_AGAIN, PEAK_LEFT, PEAK_START } PeakKind;

/* Of a run's derivatives, where they are asked for (peak_changes.c). */
typedef struct {
    /* Changes of the records `which` (2 PEAK_COUNT: largest and smallest of each) at the state of now, whose columns are
     * those of now; PEAK_LEFT, PEAK_START: next to the place of such an extreme by `near` [s].  The state stays. */
    void (*vary)(Solver *s, const int *which, PeakKind kind, double near);
    void (*before)(Solver *s); /* rates of all quantities just before an event */
} PeakChanges;
SHARED const PeakChanges PEAK_CHANGES;

/* What the feature keeps of PEAK_COUNT quantities. */
typedef struct {
    int columns;                      /* 0, or by how many their extremes are differentiated */
    const PeakChanges *vary;          /* NULL: by none */
    double *kept;                     /* (peaks_saved()) */
    Observed seen;
    double *work;
    int *which;                       /* (2 PEAK_COUNT) */
    double *changes, *rates, *before; /* (PEAK_COUNT) of peak_changes.c */
} Peaks;

SHARED const Feature PEAKS;
static inline Peaks *peaks_of(const Solver *s) { return feature_own(s, &PEAKS); }

/* (PEAK_PARTS) of quantity k; their changes by column c. */
static inline double *peak_record(const Peaks *x, int k) { return x->kept + PEAK_PARTS * k; }
static inline double *peak_change(const Peaks *x, int c, int k) { return x->kept + PEAK_PARTS * (PEAK_COUNT * (1 + c) + k); }
static inline double *peak_standing(const Peaks *x, int k, PeakPart part) {
    return peak_change(x, x->columns, 0) + 2 * k + (part == PEAK_MAX ? 0 : 1);
}

/* The quantities at an observed state. */
SHARED Status peaks_measure(Solver *s, const Observed *o, double *values);
#endif
