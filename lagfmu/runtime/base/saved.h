/* saved.h -- what a saved state remembers: each number is a row of a table beside what it belongs to, and from the row come
 * its member, its memory (layout.c), and what it may be when it comes back from outside (saved_check.c).
 *
 * Of a number: N(type, member, SORT, what a refusal calls it).  Of an array: A(type, member, how many, SORT, name).
 * SORT: FLAG 0 or 1; COUNT, TALLY of int, Count; SIZE 0 or more; LIMIT, and maybe infinite; FINITE any finite double;
 * OTHER is held against its own kind elsewhere. */
#ifndef LAGFMU_SAVED_H
#define LAGFMU_SAVED_H

typedef enum { FLAG, COUNT, TALLY, SIZE, LIMIT, FINITE, OTHER } Sort;

#define SAVED_MEMBER(type, member, sort, name) type member;
#define SAVED_POINTER(type, member, many, sort, name) type *member;

#endif
