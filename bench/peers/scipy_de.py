# SPDX-License-Identifier: MIT
"""scipy's differential_evolution on one data set: peers_scipy.py FILE SEED full|projected [POPSIZE TOL]

FILE holds theta_i, theta_r, dphi (radians) and f (sr^-1), a reading a line. `full` searches
(n, k, sigma, ks, kd), `projected` (n, sqrt k, log sigma) with ks and kd in closed form. The
objective is numpy over a whole population at once, with the geometry computed beforehand and no
complex numbers. Prints the time (CPU of this process, ms), Delta and the number of evaluations.
"""

import os
import sys
import time

for library in "OMP", "OPENBLAS", "MKL":
    os.environ[library + "_NUM_THREADS"] = "1"

import numpy as np
from scipy.optimize import differential_evolution

SCALE = 1e6  # of Delta: the polish takes differences below 1e-9 for nothing
LOWER = np.array([0.2, 0, 0.01, 0, 0])
UPPER = np.array([8, 10, 0.6, 1.5, 0.5])


class Surface:
    """eq. 16 at compiled geometries, for columns of parameters."""

    def __init__(self, ti, tr, dphi, f):
        hx = np.sin(ti) + np.sin(tr) * np.cos(dphi)
        hy = np.sin(tr) * np.sin(dphi)
        hz = np.cos(ti) + np.cos(tr)
        h = np.sqrt(hx**2 + hy**2 + hz**2)
        cos_b, cos_t = h / 2, hz / h
        g = np.minimum(1, 2 * cos_t * np.minimum(np.cos(ti), np.cos(tr)) / cos_b)
        self.tan2 = (hx**2 + hy**2) / hz**2
        self.c2 = cos_b**2
        self.s2 = 1 - self.c2
        self.a = g / (4 * np.pi * cos_t**4 * np.cos(ti) * np.cos(tr))
        self.b = 1 / np.cos(ti)
        self.f, self.ff, self.bb, self.bf = f, f @ f, self.b @ self.b, self.b @ f

    def specular(self, n, k, sigma):
        n, k2, v = n[:, None], k[:, None] ** 2, 0.5 / sigma[:, None] ** 2
        n2 = n * n
        d = n2 - k2 - self.s2
        m = np.sqrt(d * d + 4 * n2 * k2)
        y = np.sqrt(2 * self.c2 * (m + d))
        x = m + self.c2
        z = m * self.c2 + self.s2**2
        return v * self.a * np.exp(-v * self.tan2) * (x - y) * z / ((x + y) * (z + y * self.s2))

    def full(self, p):
        """Delta for p of shape (5,) or (5, population)."""
        n, k, sigma, ks, kd = p.reshape(5, -1)
        r = ks[:, None] * self.specular(n, k, sigma) + kd[:, None] * self.b - self.f
        return self.shaped(np.einsum("ij,ij->i", r, r) / self.ff, p)

    def projected(self, p):
        """Delta at the best ks and kd for p of shape (3,) or (3, population)."""
        n, root_k, log_sigma = p.reshape(3, -1)
        a = self.specular(n, root_k**2, np.exp(log_sigma))
        aa, ab, af = np.einsum("ij,ij->i", a, a), a @ self.b, a @ self.f
        det = aa * self.bb - ab**2
        with np.errstate(all="ignore"):
            ks = (af * self.bb - self.bf * ab) / det
            kd = (self.bf * aa - af * ab) / det
            at = [(ks, kd)]
            for s in LOWER[3], UPPER[3]:
                at.append((np.full_like(aa, s), np.clip((self.bf - s * ab) / self.bb, LOWER[4], UPPER[4])))
            for d in LOWER[4], UPPER[4]:
                at.append((np.clip((af - d * ab) / aa, LOWER[3], UPPER[3]), np.full_like(aa, d)))
        inside = (ks >= LOWER[3]) & (ks <= UPPER[3]) & (kd >= LOWER[4]) & (kd <= UPPER[4])
        q = np.array([s * (aa * s + 2 * ab * d - 2 * af) + d * (self.bb * d - 2 * self.bf) for s, d in at])
        q[0] = np.where(inside, q[0], np.inf)
        return self.shaped(1 + np.nanmin(q, axis=0) / self.ff, p)

    @staticmethod
    def shaped(delta, p):
        return delta[0] if p.ndim == 1 else delta


def main():
    path, seed, form = sys.argv[1:4]
    popsize, tol = (int(sys.argv[4]), float(sys.argv[5])) if len(sys.argv) > 4 else (15, 0.01)
    surface = Surface(*np.loadtxt(path).T)
    if form == "full":
        low, high = LOWER, UPPER
    else:
        low, high = (np.array([b[0], np.sqrt(b[1]), np.log(b[2])]) for b in (LOWER, UPPER))
    evaluations = 0

    def objective(p):
        nonlocal evaluations
        evaluations += 1 if p.ndim == 1 else p.shape[1]
        return SCALE * getattr(surface, form)(p)

    start = time.process_time()
    best = differential_evolution(
        objective, list(zip(low, high)), seed=int(seed), popsize=popsize, tol=tol, maxiter=10000,
        vectorized=True, updating="deferred", polish=True)
    print("%.4f %.12g %d" % ((time.process_time() - start) * 1e3, best.fun / SCALE, evaluations))


if __name__ == "__main__":
    main()
