/* rates.h -- the rates of prescribed motions: whether they belong to the motion, and what they are from
 * its values. */
#ifndef LAGFMU_RATES_H
#define LAGFMU_RATES_H

#include "linkage.h"

enum { RATES_KEPT = 4 }; /* points of a cubic polynomial through an estimated input */

/* The latest communication points of an estimated motion, newest first. */
typedef struct {
    int count; /* up to RATES_KEPT */
    int rated; /* 1: the newest came with its derivative */
    double t[RATES_KEPT], u[RATES_KEPT], rate;
} Past;

/* 1 where u has moved over the last step h and u' has not moved accordingly, or u' and not u''; `u` are
 * u, u', u'' as they are set, `went` where the rates have carried them to. */
SHARED int rates_half_connected(const double *u, const double *went, double h);

/* Takes up the point (t, u[0]) and puts the derivatives of the polynomial through the latest points into
 * u[1], u[2], u[3]; of the first point they are left alone.  `given`: how many of u[1], u[2] the importer
 * gave; then they stay, and the polynomial is Hermite's through the latest two points. */
SHARED void rates_estimate(Past *past, double t, double *u, int given);

#endif
