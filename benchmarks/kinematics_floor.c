/* The closed form of app/katana450/maths/kinematics in plain C, as a lower bound of the cost.
 *
 * theta1 from the tool point, theta3 from the wrist's distance, theta2 from its direction, theta4
 * and theta5 from the tool's orientation. Every angle is an atan2, for both shoulders and both
 * elbows, in the turn that fits the limits. Lengths in m, angles in rad.
 */

#include <math.h>
#include <stdint.h>

#define JOINTS 5
#define BRANCHES 4

static const double ON_AXIS = 1e-9;

static double wrapped(double theta)
{
    while (theta > M_PI)
        theta -= 2.0 * M_PI;
    while (theta <= -M_PI)
        theta += 2.0 * M_PI;
    return theta;
}

static double into_limits(double theta, double lower, double upper)
{
    theta = wrapped(theta);
    if (theta < lower && theta + 2.0 * M_PI <= upper)
        return theta + 2.0 * M_PI;
    if (theta > upper && theta - 2.0 * M_PI >= lower)
        return theta - 2.0 * M_PI;
    return theta;
}

static double positive(double radicand)
{
    return radicand > 0.0 ? radicand : 0.0;
}

/* l: three lengths. T: n poses (4, 4), row by row. q: n x 4 x 5 angles. inside: n x 4 flags. */
void inverse_batch(const double *l, const double *lower, const double *upper, double slack,
                   const double *T, int64_t n, double *q, uint8_t *inside)
{
    const double l1 = l[0], l2 = l[1], l3 = l[2];
    const double far = l1 + l2, near = fabs(l1 - l2);
    for (int64_t i = 0; i < n; i++, T += 16) {
        const double r11 = T[0], r12 = T[1], r13 = T[2], x = T[3];
        const double r21 = T[4], r22 = T[5], r23 = T[6], y = T[7];
        const double r31 = T[8], z = T[11];
        const double xw = x - l3 * r11, yw = y - l3 * r21, v = l3 * r31 - z;

        double cx = x, cy = y;
        double radius = hypot(cx, cy);
        if (radius <= ON_AXIS) {
            cx = r11, cy = r21, radius = hypot(cx, cy);
            if (radius <= ON_AXIS)
                cx = 1.0, cy = 0.0, radius = 1.0;
        }
        const double facing = atan2(cy, cx);
        const double c0 = cx / radius, s0 = cy / radius;
        const double u = c0 * xw + s0 * yw;
        const double rho = sqrt(u * u + v * v);
        const double stretched2 = positive((far - rho) * (far + rho));
        const double folded2 = positive((rho - near) * (rho + near));
        const double product = sqrt(stretched2 * folded2);
        const double bend = 2.0 * atan2(sqrt(stretched2), sqrt(folded2));
        /* bearing uses cos and sin of bend, both times stretched2 + folded2. */
        const double bearing = atan2(2.0 * l2 * product,
                                     l1 * (folded2 + stretched2) + l2 * (folded2 - stretched2));

        /* With the shoulder to the back c and s change sign, which mirrors three of the angles. */
        const double wrist0 = atan2(v, u);
        const double phi0 = atan2(-r31, c0 * r11 + s0 * r21);
        const double roll0 = atan2(s0 * r13 - c0 * r23, c0 * r22 - s0 * r12);

        for (int back = 0; back < 2; back++) {
            const double wrist = back ? M_PI - wrist0 : wrist0;
            const double phi = back ? M_PI - phi0 : phi0;
            const double roll = back ? roll0 + M_PI : roll0;
            for (int down = 0; down < 2; down++) {
                double *a = q + (i * BRANCHES + 2 * back + down) * JOINTS;
                a[0] = back ? facing + M_PI : facing;
                a[2] = down ? -bend : bend;
                a[1] = down ? wrist + bearing : wrist - bearing;
                a[3] = phi - a[1] - a[2];
                a[4] = roll;
                uint8_t fits = 1;
                for (int j = 0; j < JOINTS; j++) {
                    a[j] = into_limits(a[j], lower[j], upper[j]);
                    fits &= a[j] >= lower[j] - slack && a[j] <= upper[j] + slack;
                }
                inside[i * BRANCHES + 2 * back + down] = fits;
            }
        }
    }
}
