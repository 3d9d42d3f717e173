/* stiffened.h -- a singular mass matrix made definite by constraints that hold it. */
#ifndef LAGFMU_STIFFENED_H
#define LAGFMU_STIFFENED_H

#include "linear.h"
#include "linkage.h"

/* Which rows may do that: those whose coordinates the mass matrix couples each with each. */
SHARED void stiffened_layout(Linear *l, Arena *arena);

/* l->M <- M + sum_k sigma_k g_k g_k^T over such rows that act; 0 if there are none. */
SHARED int stiffened_masses(Linear *l);

/* b + sum_k sigma_k g_k c_k (n; lost at the next call), with which x and lambda are those of b and M. */
SHARED const double *stiffened_forces(const Linear *l, const double *b, const double *c);

/* 1 if lambda keeps its digits beside sigma_k c_k, from which it was had, or is none beside other forces. */
SHARED int stiffened_tells(const Linear *l, const double *b, const double *c, const double *lambda);

/* M as it was given, which is not definite: for a rung that needs nothing added. */
SHARED void stiffened_undo(Linear *l);

#endif
