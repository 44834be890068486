"""The Matérn-5/2 kernel of an implicit surface between values and slopes (compiled).

    d = x - x', r = |d|, t = sqrt(5) r / l          s   standard deviation, m      l   length scale, m
    k = s^2 (1 + t + t^2 / 3) exp(-t)
    A = k' / r = -s^2 5 / (3 l^2) (1 + t) exp(-t)
    B = A' / r =  s^2 25 / (3 l^4) exp(-t)
    C = B' / r = -s^2 25 sqrt(5) / (3 l^5 r) exp(-t)

    cov(f, f') = k      cov(f, df') = -A d      cov(df, df') = -(A I + B d d')
    d2k/dx2 = A I + B d d'      d3k/dx3 = B (d_i I_jk + d_j I_ik + d_k I_ij) + C d_i d_j d_k
(Rasmussen and Williams 2006, eq. 4.17; the derivatives follow from it.)

Observations are n values and m slopes of three components; weights carry q columns, one for each function that is
evaluated: alpha (n, q) of the values, beta (m, 3, q) of the slopes.
"""

import numpy as np

from surehold.store.kernels import njit

__all__ = ["covariance", "cross_covariance", "fast_function_values", "function_derivatives", "function_values"]

_ROOT5 = np.sqrt(5.0)
_BLOCK = 128  # rows


@njit(cache=True)
def function_values(x, points, slopes, alpha, beta, std, length):
    """Return the functions (p, q) at x (p, 3), without their prior mean."""
    n, m, q = points.shape[0], slopes.shape[0], alpha.shape[1]
    out = np.zeros((x.shape[0], q))
    variance, over = std * std, _ROOT5 / length
    first = -variance * 5.0 / (3.0 * length * length)
    for p in range(x.shape[0]):
        px, py, pz = x[p, 0], x[p, 1], x[p, 2]
        for j in range(n):
            dx, dy, dz = px - points[j, 0], py - points[j, 1], pz - points[j, 2]
            t = over * np.sqrt(dx * dx + dy * dy + dz * dz)
            k = variance * (1.0 + t + t * t / 3.0) * np.exp(-t)
            for c in range(q):
                out[p, c] += k * alpha[j, c]
        for j in range(m):
            dx, dy, dz = px - slopes[j, 0], py - slopes[j, 1], pz - slopes[j, 2]
            t = over * np.sqrt(dx * dx + dy * dy + dz * dz)
            a = first * (1.0 + t) * np.exp(-t)
            for c in range(q):
                out[p, c] -= a * (dx * beta[j, 0, c] + dy * beta[j, 1, c] + dz * beta[j, 2, c])
    return out


def fast_function_values(x, points, slopes, alpha, beta, std, length):
    """Return what `function_values` does, in single precision: to some micrometers, for the nodes of a grid.

    Distances and weighted sums are products of matrices; a block of rows stays in the processor's cache.
    """
    n, q = alpha.shape
    places = np.concatenate([points, slopes])
    middle = places.mean(axis=0) if len(places) else np.zeros(3)
    scaled = ((places - middle) * (_ROOT5 / length)).astype(np.float32)
    square = np.sum(scaled * scaled, axis=1)
    values = (std * std * alpha).astype(np.float32)
    inner = (-std * std * _ROOT5 / (3.0 * length) * beta).astype(np.float32)  # A d' beta, d in units of l / sqrt(5)
    along = np.einsum("mi,miq->mq", scaled[n:], inner)
    weights = np.concatenate([inner[:, 0], inner[:, 1], inner[:, 2], along], axis=1)
    out = np.empty((len(x), q))
    for start in range(0, len(x), _BLOCK):
        u = ((x[start : start + _BLOCK] - middle) * (_ROOT5 / length)).astype(np.float32)
        t = u @ (-2.0 * scaled.T)
        t += square
        t += np.sum(u * u, axis=1)[:, None]
        np.sqrt(np.maximum(t, 0.0, out=t), out=t)
        decay = np.exp(-t)
        near = t[:, :n] * np.float32(1.0 / 3.0)
        near += 1.0
        near *= t[:, :n]
        near += 1.0
        near *= decay[:, :n]
        sums = near @ values
        if len(slopes):
            turned = t[:, n:]
            turned += 1.0
            turned *= decay[:, n:]
            parts = (turned @ weights).reshape(-1, 4, q)
            sums -= np.einsum("pi,piq->pq", u, parts[:, :3]) - parts[:, 3]
        out[start : start + _BLOCK] = sums
    return out


@njit(cache=True)
def function_derivatives(x, points, slopes, alpha, beta, std, length):
    """Return gradient (p, 3) and second derivatives (p, 3, 3) of one function at x (p, 3), without its prior mean."""
    gradient = np.zeros((x.shape[0], 3))
    hessian = np.zeros((x.shape[0], 3, 3))
    variance, over = std * std, _ROOT5 / length
    d = np.empty(3)
    for p in range(x.shape[0]):
        for j in range(points.shape[0] + slopes.shape[0]):
            slope = j >= points.shape[0]
            place = slopes[j - points.shape[0]] if slope else points[j]
            r = 0.0
            for i in range(3):
                d[i] = x[p, i] - place[i]
                r += d[i] * d[i]
            r = np.sqrt(r)
            decay = np.exp(-over * r)
            a = -variance * 5.0 / (3.0 * length**2) * (1.0 + over * r) * decay
            b = variance * 25.0 / (3.0 * length**4) * decay
            if not slope:
                for i in range(3):
                    gradient[p, i] += alpha[j, 0] * a * d[i]
                    for k in range(3):
                        hessian[p, i, k] += alpha[j, 0] * (b * d[i] * d[k] + (a if i == k else 0.0))
                continue
            w = beta[j - points.shape[0], :, 0]
            along = w[0] * d[0] + w[1] * d[1] + w[2] * d[2]
            c = 0.0 if r < 1e-12 else -variance * 25.0 * _ROOT5 / (3.0 * length**5 * r) * decay
            for i in range(3):
                gradient[p, i] -= a * w[i] + b * along * d[i]
                for k in range(3):
                    term = b * (d[i] * w[k] + w[i] * d[k] + (along if i == k else 0.0)) + c * along * d[i] * d[k]
                    hessian[p, i, k] -= term
    return gradient, hessian


@njit(cache=True)
def cross_covariance(x, points, slopes, std, length):
    """Return the covariances (p, n + 3 m) of values at x (p, 3) with all observations, those of the values first."""
    n, m = points.shape[0], slopes.shape[0]
    out = np.empty((x.shape[0], n + 3 * m))
    variance, over = std * std, _ROOT5 / length
    for p in range(x.shape[0]):
        for j in range(n):
            dx, dy, dz = x[p, 0] - points[j, 0], x[p, 1] - points[j, 1], x[p, 2] - points[j, 2]
            t = over * np.sqrt(dx * dx + dy * dy + dz * dz)
            out[p, j] = variance * (1.0 + t + t * t / 3.0) * np.exp(-t)
        for j in range(m):
            dx, dy, dz = x[p, 0] - slopes[j, 0], x[p, 1] - slopes[j, 1], x[p, 2] - slopes[j, 2]
            t = over * np.sqrt(dx * dx + dy * dy + dz * dz)
            a = -variance * 5.0 / (3.0 * length * length) * (1.0 + t) * np.exp(-t)
            out[p, n + 3 * j], out[p, n + 3 * j + 1], out[p, n + 3 * j + 2] = -a * dx, -a * dy, -a * dz
    return out


@njit(cache=True)
def covariance(points, slopes, std, length):
    """Return the covariance (n + 3 m, n + 3 m) of all observations without their noise."""
    n, m = points.shape[0], slopes.shape[0]
    out = np.empty((n + 3 * m, n + 3 * m))
    out[:n] = cross_covariance(points, points, slopes, std, length)
    over = _ROOT5 / length
    d = np.empty(3)
    for i in range(m):
        for u in range(3):
            for j in range(n):
                out[n + 3 * i + u, j] = out[j, n + 3 * i + u]
        for j in range(m):
            r = 0.0
            for u in range(3):
                d[u] = slopes[i, u] - slopes[j, u]
                r += d[u] * d[u]
            t = over * np.sqrt(r)
            decay = std * std * np.exp(-t)
            a, b = -5.0 / (3.0 * length**2) * (1.0 + t) * decay, 25.0 / (3.0 * length**4) * decay
            for u in range(3):
                for v in range(3):
                    out[n + 3 * i + u, n + 3 * j + v] = -b * d[u] * d[v] - (a if u == v else 0.0)
    return out
