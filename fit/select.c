// SPDX-License-Identifier: MIT
#include "fit/select.h"

#include <math.h>

static void swap(double *a, double *b)
{
    double t = *a;
    *a = *b;
    *b = t;
}

// Afterwards values[k] is the k-th smallest, nothing before it larger, nothing after it smaller
// (Hoare 1961). The middle one as pivot makes sorted and equal values cheap.
static void partition(double *values, size_t count, size_t k)
{
    size_t low = 0, high = count - 1;
    while (low < high) {
        double pivot = values[low + (high - low) / 2];
        size_t i = low, j = high;
        while (i <= j) {
            while (values[i] < pivot)
                i++;
            while (pivot < values[j])
                j--;
            if (i > j)
                break;
            swap(&values[i++], &values[j]);
            if (j == 0)
                break;
            j--;
        }
        if (k <= j)
            high = j;
        else if (k >= i)
            low = i;
        else
            return;
    }
}

double select_quantile(double *values, size_t count, double p)
{
    double place = p * (double)(count - 1);
    size_t below = (size_t)place;
    partition(values, count, below);
    double low = values[below], next = (double)INFINITY;
    if (below + 1 == count)
        return low;
    for (size_t i = below + 1; i < count; i++)
        next = fmin(next, values[i]);
    return low + (place - (double)below) * (next - low);
}
