"""The arithmetic of the studies: growth exponents, how far a cost is from linear, performance profiles. No files, no pictures."""
import math


def growth(sizes, costs):
    """(exponent, factor) of the least squares line of log cost over log size: cost = factor * size ** exponent."""
    points = [(math.log(n), math.log(t)) for n, t in zip(sizes, costs, strict=True)]
    if len({x for x, _ in points}) < 2:
        raise ValueError("growth: at least two different sizes are needed")
    mean_x = sum(x for x, _ in points) / len(points)
    mean_y = sum(y for _, y in points) / len(points)
    exponent = sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)
    return exponent, math.exp(mean_y - exponent * mean_x)


def off_linear(sizes, costs):
    """Largest relative distance of the cost per unit from its median."""
    each = [t / n for n, t in zip(sizes, costs, strict=True)]
    ordered = sorted(each)
    half = len(ordered) // 2
    middle = ordered[half] if len(ordered) % 2 else 0.5 * (ordered[half - 1] + ordered[half])
    return max(abs(x / middle - 1) for x in each)


def time_to(tolerance, attempts):
    """Least time of the attempts (time, error reached) whose error is at most the tolerance; infinity if there is none."""
    return min((t for t, error in attempts if error <= tolerance), default=math.inf)


def ratios(times):
    """Per solver the list of time over the least time of any solver, problem by problem [DM02]. times: {solver: [seconds]},
    infinity where a solver failed; a problem that none solves stays infinite for all and still counts."""
    solvers = list(times)
    counts = {len(times[s]) for s in solvers}
    if len(counts) != 1:
        raise ValueError(f"ratios: solvers with different numbers of problems: {sorted(counts)}")
    result = {s: [] for s in solvers}
    for k in range(counts.pop()):
        least = min(times[s][k] for s in solvers)
        for s in solvers:
            result[s].append(times[s][k] / least if math.isfinite(times[s][k]) else math.inf)
    return result


def profile(solver_ratios):
    """Steps of rho(tau), the share of problems solved within tau times the least time: [(tau, share)], tau rising."""
    finite = sorted(r for r in solver_ratios if math.isfinite(r))
    steps = []
    for k, tau in enumerate(finite, start=1):
        if steps and steps[-1][0] == tau:
            steps.pop()
        steps.append((tau, k / len(solver_ratios)))
    return steps
