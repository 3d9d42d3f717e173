/* restrict.h -- C99's restrict, by the name that MSVC has for it. */
#ifndef LAGFMU_RESTRICT_H
#define LAGFMU_RESTRICT_H

#if defined(_MSC_VER) && !defined(__clang__)
#define RESTRICT __restrict
#else
#define RESTRICT restrict
#endif

#endif
