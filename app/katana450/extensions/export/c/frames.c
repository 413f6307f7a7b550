/* Poses of all links. Licence: MIT. */
#include "kinematics.h"

#include "links_data.h"

#include <math.h>

/* T = A B for poses. */
static void multiply(const double A[16], const double B[16], double T[16])
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 4; j++)
            T[4 * i + j] = A[4 * i] * B[j] + A[4 * i + 1] * B[4 + j] + A[4 * i + 2] * B[8 + j] +
                           (j == 3 ? A[4 * i + 3] : 0.0);
    T[12] = T[13] = T[14] = 0.0;
    T[15] = 1.0;
}

/* The pose that a joint adds at a value [rad or m]. */
static void motion(const link_data *link, double value, double T[16])
{
    const double x = link->axis[0], y = link->axis[1], z = link->axis[2];
    double s, v;
    if (link->slides) {
        const double moved[16] = {1.0, 0.0, 0.0, value * x, 0.0, 1.0, 0.0, value * y,
                                  0.0, 0.0, 1.0, value * z, 0.0, 0.0, 0.0, 1.0};
        int k;
        for (k = 0; k < 16; k++)
            T[k] = moved[k];
        return;
    }
    /* 1 - cos in a form that keeps its digits near 0. */
    s = sin(value);
    v = sin(0.5 * value);
    v = 2.0 * v * v;
    T[0] = 1.0 - v * (y * y + z * z);
    T[1] = v * x * y - s * z;
    T[2] = v * x * z + s * y;
    T[4] = v * x * y + s * z;
    T[5] = 1.0 - v * (x * x + z * z);
    T[6] = v * y * z - s * x;
    T[8] = v * x * z - s * y;
    T[9] = v * y * z + s * x;
    T[10] = 1.0 - v * (x * x + y * y);
    T[3] = T[7] = T[11] = T[12] = T[13] = T[14] = 0.0;
    T[15] = 1.0;
}

void robot_frames(const double q[], double T[ROBOT_LINKS][16])
{
    static const double identity[16] = {1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0,
                                        0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0};
    double placed[16], moved[16];
    int k;
    for (k = 0; k < ROBOT_LINKS; k++) {
        const link_data *link = &links[k];
        multiply(link->parent < 0 ? identity : T[link->parent], link->place, placed);
        motion(link, link->joint < 0 ? 0.0 : link->factor * q[link->joint] + link->offset, moved);
        multiply(placed, moved, T[k]);
    }
}

const char *robot_link_name(int link)
{
    return link < 0 || link >= ROBOT_LINKS ? (const char *)0 : links[link].name;
}
