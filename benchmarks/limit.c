/* What C reaches with the nominal joint: the limit that benchmarks/simulation_bench.py compares with.
 *
 *     cc -O3 -march=native -ffast-math -fopenmp-simd benchmarks/limit.c -o limit -lm && ./limit
 *
 * Written apart from the suite: two flow valves, two ideal braids, one hinge; RK4 with held commands.
 * The same loop is compiled twice: with one lane, and with LANES lanes side by side, which the compiler
 * turns into vectors. Prints million steps per second, and the last angle, on which both must agree.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#ifndef LANES
#define LANES 16
#endif
#define STATES 6 /* angle, speed, spool and absolute pressure of two muscles */

typedef struct {
    double ambient, supply, per_mass, exponent, per_lag, conductance, critical, bend;
    double radius, neutral, b2, scale, dead, per_inertia, viscous, gravity, upper;
} Joint;

static inline double flow(double conductance, double critical, double bend, double up, double down) {
    double full = (1.0 - critical) * up;
    double part = fmax(fmin(down, bend * up) - critical * up, 0.0);
    double linear = fmin(up - down, (1.0 - bend) * up);
    return conductance * sqrt(full * full - part * part) * linear / ((1.0 - bend) * full);
}

static inline double muscle(const Joint *j, double length, double length_rate, double command,
                            double spool, double pressure, double *spool_rate, double *pressure_rate) {
    double square = length * length;
    double volume = length * (j->b2 - square) * j->scale + j->dead;
    double slope = (j->b2 - 3.0 * square) * j->scale;
    double up = spool >= 0.0 ? j->supply : pressure;
    double down = spool >= 0.0 ? pressure : j->ambient;
    double entering = flow(spool * j->conductance, j->critical, j->bend, up, down);
    *spool_rate = (command - spool) * j->per_lag;
    *pressure_rate = (j->per_mass * entering - j->exponent * pressure * slope * length_rate) / volume;
    double pull = (pressure - j->ambient) * (3.0 * square - j->b2) * j->scale;
    return fmax(pull, 0.0);
}

static inline void rates(const Joint *j, const double *restrict u, const double *restrict y, double *restrict dy,
                         int lanes) {
#pragma omp simd
    for (int i = 0; i < lanes; i++) {
        double q = y[i], v = y[lanes + i], turned = j->radius * q, wound = j->radius * v;
        double first = muscle(j, j->neutral - turned, -wound, u[i], y[2 * lanes + i], y[3 * lanes + i],
                              &dy[2 * lanes + i], &dy[3 * lanes + i]);
        double second = muscle(j, j->neutral + turned, wound, u[lanes + i], y[4 * lanes + i],
                               y[5 * lanes + i], &dy[4 * lanes + i], &dy[5 * lanes + i]);
        dy[i] = v;
        dy[lanes + i] = (j->radius * (first - second) - j->viscous * v - j->gravity * sin(q)) * j->per_inertia;
    }
}

/* GCC turns the loop into vectors only where it stands in a function of its own. */
__attribute__((noinline)) static void rates_of_lanes(const Joint *j, const double *restrict u,
                                                     const double *restrict y, double *restrict dy) {
    rates(j, u, y, dy, LANES);
}

static inline void add(const double *y, const double *dy, double h, double *to, int lanes) {
    for (int i = 0; i < STATES * lanes; i++) to[i] = y[i] + h * dy[i];
}

static inline void step(const Joint *j, const double *u, double *y, double h, int lanes) {
    double k1[STATES * LANES], k2[STATES * LANES], k3[STATES * LANES], k4[STATES * LANES], ys[STATES * LANES];
    double *const ks[4] = {k1, k2, k3, k4};
    const double parts[4] = {0.0, 0.5, 0.5, 1.0};
    const double *from = y;
    for (int r = 0; r < 4; r++) {
        if (r > 0) {
            add(y, ks[r - 1], parts[r] * h, ys, lanes);
            from = ys;
        }
        if (lanes == 1) rates(j, u, from, ks[r], 1);
        else rates_of_lanes(j, u, from, ks[r]);
    }
    for (int i = 0; i < STATES * lanes; i++) y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    for (int i = 0; i < lanes; i++) {
        int high = y[i] >= j->upper, low = y[i] <= -j->upper;
        y[lanes + i] = (high && y[lanes + i] > 0.0) || (low && y[lanes + i] < 0.0) ? 0.0 : y[lanes + i];
        y[i] = high ? j->upper : low ? -j->upper : y[i];
    }
}

static double run(const Joint *j, long samples, int lanes, double *rate) {
    double y[STATES * LANES], u[2 * LANES];
    const double h = 2.5e-4;
    const int steps = 8;
    for (int i = 0; i < lanes; i++) {
        y[i] = y[lanes + i] = y[2 * lanes + i] = y[4 * lanes + i] = 0.0;
        y[3 * lanes + i] = y[5 * lanes + i] = j->ambient;
    }
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (long k = 0; k < samples; k++) {
        for (int i = 0; i < lanes; i++) {
            u[i] = 0.05 * sin(2.0 * M_PI * k * steps * h);
            u[lanes + i] = -u[i];
        }
        for (int s = 0; s < steps; s++) step(j, u, y, h, lanes);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    double seconds = (end.tv_sec - begin.tv_sec) + 1e-9 * (end.tv_nsec - begin.tv_nsec);
    *rate = 1e-6 * samples * steps * lanes / seconds;
    return y[0];
}

__attribute__((noinline)) static double one(const Joint *j, long n, double *rate) { return run(j, n, 1, rate); }
__attribute__((noinline)) static double many(const Joint *j, long n, double *rate) { return run(j, n, LANES, rate); }

int main(void) {
    const double density = 1.185, rt = 287.05 * 293.15, b = 0.2758, critical = 0.3, linear = 0.999;
    Joint j = {101325.0, 701325.0, rt * density, 1.0, 200.0, 4e-9, critical, linear, 0.03, 0.225, b * b,
               0.02310118149720259, 2e-5, 20.0, 0.25, 4.9, 1.0};
    double best_one = 0.0, best_many = 0.0, rate, first = 0.0, second = 0.0;
    for (int i = 0; i < 300; i++) { /* many short runs, as other work on the machine interrupts long ones */
        first = one(&j, 200, &rate);
        best_one = rate > best_one ? rate : best_one;
        second = many(&j, 200, &rate);
        best_many = rate > best_many ? rate : best_many;
    }
    printf("{\"scalar\": %.3f, \"lanes\": %.3f, \"angles\": [%.17g, %.17g]}\n", best_one, best_many, first, second);
    return 0;
}
