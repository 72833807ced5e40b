/* The limit: a Kalman filter by hand for sizes that the compiler knows.
 *
 * Conventional covariance form; the innovation covariance is reduced to L D L', and every pivot takes
 * its share from the covariance. NaN is missing. With ROBUST the components are weighed by IGG3.
 * Build: gcc -O3 -march=native -shared -fPIC -DN=6 -DM=3 [-DROBUST] kalman.c -o … -lm
 */
#include <math.h>
#include <string.h>

static inline double igg3(double v, double k0, double k1)
{
    if (v <= k0) return 1.0;
    if (v >= k1) return 0.0;
    return k0 / v * (k1 - v) / (k1 - k0);
}

void filter(long count, const double *restrict F, const double *restrict Q,
            const double *restrict H, const double *restrict R, const double *restrict z,
            const double *restrict mean0, const double *restrict covariance0,
            double *restrict mean, double *restrict covariance, double k0, double k1)
{
    double m[N], P[N][N], A[N][N], B[M][N], S[M][M], e[M];
    int used[M];
    memcpy(m, mean0, sizeof m);
    memcpy(P, covariance0, sizeof P);
    for (long t = 0; t < count; t++) {
        double x[N];
        for (int i = 0; i < N; i++) {
            double sum = 0.0, row[N] = {0};
            for (int j = 0; j < N; j++) sum += F[i * N + j] * m[j];
            x[i] = sum;
            for (int k = 0; k < N; k++)
                for (int j = 0; j < N; j++) row[j] += F[i * N + k] * P[k][j];
            memcpy(A[i], row, sizeof row);
        }
        for (int i = 0; i < N; i++) {
            double row[N];
            memcpy(row, Q + i * N, sizeof row);
            for (int k = 0; k < N; k++)
                for (int j = 0; j < N; j++) row[j] += A[i][k] * F[j * N + k];
            memcpy(P[i], row, sizeof row);
        }
        for (int c = 0; c < M; c++) {
            double row[N] = {0};
            for (int k = 0; k < N; k++)
                for (int j = 0; j < N; j++) row[j] += H[c * N + k] * P[k][j];
            memcpy(B[c], row, sizeof row);
            e[c] = z[t * M + c];
            for (int j = 0; j < N; j++) e[c] -= H[c * N + j] * x[j];
            used[c] = !isnan(e[c]);
            for (int d = 0; d <= c; d++) {
                S[c][d] = R[c * M + d];
                for (int j = 0; j < N; j++) S[c][d] += B[c][j] * H[d * N + j];
            }
        }
#ifdef ROBUST
        double root[M];
        for (int c = 0; c < M; c++) {
            double w = used[c] ? igg3(fabs(e[c]) / sqrt(S[c][c]), k0, k1) : 1.0;
            if (w > 0.0) root[c] = 1.0 / sqrt(w);
            else used[c] = 0, root[c] = 1.0;
        }
        for (int c = 0; c < M; c++)
            for (int d = 0; d <= c; d++) S[c][d] += R[c * M + d] * (root[c] * root[d] - 1.0);
#endif
        for (int c = 0; c < M; c++) {
            if (!used[c]) continue;
            double inverse = 1.0 / S[c][c], share = inverse * e[c];
            for (int d = c + 1; d < M; d++) {
                if (!used[d]) continue;
                double l = S[d][c] * inverse;
                for (int q = c + 1; q <= d; q++) S[d][q] -= l * S[q][c];
                for (int j = 0; j < N; j++) B[d][j] -= l * B[c][j];
                e[d] -= l * e[c];
            }
            for (int i = 0; i < N; i++) {
                double gain = B[c][i] * inverse;
                x[i] += B[c][i] * share;
                for (int j = 0; j < N; j++) P[i][j] -= gain * B[c][j];
            }
        }
        memcpy(m, x, sizeof m);
        memcpy(mean + t * N, x, sizeof x);
        memcpy(covariance + t * N * N, P, sizeof P);
    }
}
