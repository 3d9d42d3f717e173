/* status.h -- what a numerical function returns, and where it says why it could not go on. */
#ifndef LAGFMU_STATUS_H
#define LAGFMU_STATUS_H

#include "linkage.h"

typedef enum { OK = 0, FAILED = 1 } Status;

enum { WHY_LENGTH = 1024 };

/* The cause of the latest failure, as a sentence for the importer's log. */
typedef struct {
    char text[WHY_LENGTH];
} Why;

/* Writes the cause (printf's format, cut to the buffer with dots at its end) and returns FAILED. */
SHARED Status fail(Why *why, const char *format, ...);

/* Appends to the cause, cut likewise. */
SHARED void why_append(Why *why, const char *format, ...);

#endif
