/* batch.h -- many runs of one instance in one call: the inner loop of a study (lagfmu sweep), and of a page's
 * run, which so costs what the runs cost and nothing for the caller's language.  Not part of the standard; an
 * importer that knows it not misses nothing.  A layout that changes takes another name. */
#ifndef LAGFMU_BATCH_H
#define LAGFMU_BATCH_H

#include <stddef.h>

#include "instance.h"
#include "linkage.h"

typedef enum { KEEP_LAST, KEEP_MAX, KEEP_MIN, KEEP_MEAN, KEEP_TIME_OF_MAX } Keep;
typedef enum { RUN_DONE = 0, RUN_STOPPED = 2, RUN_REFUSED = 3 } RunStatus; /* as FMI numbers discard and error */

/* Runs r = 0 .. runs - 1 from times[0] to times[points - 1] [s].  What is kept of a variable is taken over
 * the communication points; the mean is the trapezoidal rule's.  Variables are value references.  All arrays
 * are the caller's. */
typedef struct {
    size_t runs, varied, driven, points, kept;
    const unsigned *vary;   /* (varied) set before initialization, ... */
    const double *values;   /* (runs * varied) ... to these */
    const unsigned *drive;  /* (driven) inputs, ... */
    const double *drives;   /* (points * driven) ... set at the communication points */
    const double *times;    /* (points) [s] */
    double tolerance;       /* of the experiment; 0: none */
    const unsigned *keep;   /* (kept) what is read, ... */
    const int *what;        /* ... and a Keep */
    int whole;              /* 1: `trajectory` is wanted */
    double *result;         /* (runs * kept) */
    double *trajectory;     /* (runs * points * kept) */
    int *status;            /* (runs) RunStatus */
    double *reached;        /* (runs) [s] */
    double *scratch;        /* (2 * kept) */
    size_t current;         /* the run under way, for whoever reads the log */
} Batch;

/* Tries every run from `current` on; why one ends early is told as its status stands.  The instance is as new at
 * the end. */
SHARED void batch_run(Instance *x, Batch *batch);

#endif
