/* plan.h -- the order of a sparse elimination, found when the FMU was built (sparsity.py).
 *
 *   P M P^T = L D L^T ,   W = L^-1 P G^T ,   S = G M^-1 G^T = W^T D^-1 W ,   P' S P'^T = L' D' L'^T
 *
 * The members stand in the order of the dataclasses in sparsity.py, which prints them. */
#ifndef LAGFMU_PLAN_H
#define LAGFMU_PLAN_H

/* A symmetric matrix that is eliminated in a fixed order, with the pattern of its factor L below
 * the diagonal: row p of L holds column[start[p]] ... column[start[p + 1] - 1], ascending. */
typedef struct {
    int size;
    int forest;         /* 1: eliminating one row never changes another's off-diagonal elements */
    int widest;         /* most non-zeros in a row: bounds the norm at unit diagonal */
    const int *order;   /* (size) which row of the matrix is eliminated p-th */
    const int *start;   /* (size + 1) */
    const int *column;  /* (start[size]) */
    const int *overlap; /* (size) how many rows of L^-1 that enter row p have a column in common */
} Elimination;

typedef struct {
    int diagonal; /* 1: M is diagonal; then L = 1, W^T = G, and `mass` and `w` are empty */
    int massless; /* 1: a diagonal element of M is structurally zero; there is no elimination */
    Elimination mass;         /* of M */
    const int *mass_diagonal; /* (nv) where M's value of the p-th pivot stands in the list of M */
    const int *mass_value;    /* (mass.start[nv]) the same for the elements of L; -1: fill */
    const int *w_start;       /* (m + 1) row k of W^T ... */
    const int *w_column;      /* (w_start[m]) ... its non-zeros, in M's order, ascending */
    const int *w_value;       /* (w_start[m]) where G's value stands in the list of G; -1: fill */
    Elimination schur;        /* of S */
    const int *pair_start;    /* (schur.start[m] + 1) S_pq = sum of W_a (D^-1 W)_b over pairs */
    const int *pair_a;        /* indices into W, or into the list of G if M is diagonal */
    const int *pair_b;
} Plan;

#endif
