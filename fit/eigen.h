// SPDX-License-Identifier: MIT
// Eigenvalues of a small symmetric matrix by Jacobi rotations: accurate also for tiny eigenvalues.
#pragma once
#include "fit/fit.h"

// a = sum value[i] vector[i] vector[i]^T; vectors are rows, orthonormal; in no order. a must be
// finite.
void eigen_symmetric(const double a[FIT_PARAMS][FIT_PARAMS], double ret_value[FIT_PARAMS],
                     double ret_vector[FIT_PARAMS][FIT_PARAMS]);
