/* problem.h -- how a simulation of MODEL_SYSTEM starts.  problem.c is written by native.py from the
 * model's own table. */
#ifndef PROBLEM_H
#define PROBLEM_H

#include "variables.h"

extern const double PROBLEM_Q[], PROBLEM_V[], PROBLEM_P[]; /* start values and parameters, SI */
extern const double PROBLEM_SCALE[]; /* (2 n) below it errors are measured absolutely */

#endif
