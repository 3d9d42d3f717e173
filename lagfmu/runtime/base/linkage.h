/* linkage.h -- names that the runtime's files share with each other, and with nobody else.
 *
 * Compiled file by file they have external linkage.  An FMU's sources are compiled as one file, all.c: there
 * they are static, so that nothing but the interface is exported, and two FMUs link into one program (FMI 2.0.5,
 * sect. 2.1.1: a prefix of its functions).  A function is declared SHARED; a value too, and its definition is
 * SHARED_VALUE. */
#ifndef LAGFMU_LINKAGE_H
#define LAGFMU_LINKAGE_H

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF /* each operation is rounded by itself, whatever the options; gcc does so with -std=c99 */
#endif

#ifndef LAGFMU_IN_ONE_FILE
#define SHARED extern
#define SHARED_VALUE
#else
#define SHARED static
#define SHARED_VALUE static
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-function" /* not every FMU holds and calls everything */
#endif
#endif

#endif
