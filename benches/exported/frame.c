/* Measures the time per frame of 10 row-wires of a decoder in C. BUNDLE is the prefix of its names, READING the type
 * of a reading, COORDINATES the name of the decoded coordinates in an answer. */
#define JOINED(a, b) a##b
#define NAME(a, b) JOINED(a, b)
#define _POSIX_C_SOURCE 199309L
#include HEADER
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define ROWS 10
#define CHANNELS 30
#define ANSWER NAME(BUNDLE, _answer)

static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int count, char **arguments)
{
    static READING readings[ROWS][CHANNELS];
    static ANSWER answers[ROWS];
    const int frames = 2000;
    double best = 1e9, sum = 0;
    FILE *file = count > 1 ? fopen(arguments[1], "r") : NULL;
    for (int row = 0; row < ROWS; ++row) {
        for (int i = 0; i < CHANNELS; ++i) {
            double value = 0;
            if (!file || fscanf(file, "%lf", &value) != 1) {
                return 1;
            }
            readings[row][i] = (READING)value;
        }
    }
    for (int round = 0; round < 25; ++round) {
        const double start = seconds();
        for (int frame = 0; frame < frames; ++frame) {
            for (int row = 0; row < ROWS; ++row) {
#ifdef TAKES_ROW
                NAME(BUNDLE, _decode)(row + 1, readings[row], &answers[row]);
#else
                NAME(BUNDLE, _decode)(readings[row], &answers[row]);
#endif
            }
            sum += (double)answers[frame % ROWS].COORDINATES[2];
        }
        const double each = (seconds() - start) / frames;
        best = each < best ? each : best;
    }
    printf("%.3f\n", 1e6 * best);
    return sum == 0.5;
}
