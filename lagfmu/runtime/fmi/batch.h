/* batch.h -- many runs of one instance in one call: the inner loop of a study (lagfmu sweep), which so
 * costs what the runs cost and nothing for the caller's language.  Not part of the standard; an importer
 * that knows it not misses nothing. */
#ifndef LAGFMU_BATCH_H
#define LAGFMU_BATCH_H

#include "fmi2.h"

typedef enum { KEEP_LAST, KEEP_MAX, KEEP_MIN, KEEP_MEAN, KEEP_TIME_OF_MAX } Keep;
typedef enum { BATCH_REAL, BATCH_INTEGER, BATCH_BOOLEAN } BatchType;

/* Runs r = 0 .. runs - 1 from times[0] to times[points - 1] [s].  What is kept of a variable is taken over
 * the communication points and the departures between them; the mean is the trapezoidal rule's over the
 * points.  All arrays are the caller's. */
typedef struct {
    size_t runs, varied, driven, points, kept, events;
    const fmi2ValueReference *vary;   /* (varied) set before initialization, ... */
    const int *vary_type;             /* ... of a BatchType, ... */
    const double *values;             /* (runs * varied) ... to these */
    const fmi2ValueReference *drive;  /* (driven) inputs, ... */
    const double *drives;             /* (points * driven) ... set at the communication points */
    const double *times;              /* (points) [s] */
    double tolerance;                 /* of fmi2SetupExperiment; 0: none */
    const fmi2ValueReference *keep;   /* (kept) what is read, ... */
    const int *keep_type, *keep_what; /* ... of a BatchType, and a Keep */
    const fmi2ValueReference *count;  /* (events) Integers that count departures, ... */
    const fmi2ValueReference *when;   /* ... and Reals, the time of the latest [s] */
    int whole;                        /* 1: `trajectory` is wanted */
    double *result;                   /* (runs * kept) */
    double *trajectory;               /* (runs * points * kept) */
    int *status;                      /* (runs) fmi2Status of the call that ended the run, or fmi2OK */
    double *reached;                  /* (runs) [s] */
    double *scratch;                  /* (2 * kept) */
    size_t current;                   /* the run under way, for whoever reads the log */
} Batch;

#define lagfmu_batch FMI2_NAME(lagfmu_batch)

/* fmi2OK if every run was tried; what became of each stands in `status`.  fmi2Fatal if the instance can no
 * longer be reset: the runs from `current` on were not tried. */
FMI2_EXPORT fmi2Status lagfmu_batch(fmi2Component c, Batch *batch);

#endif
