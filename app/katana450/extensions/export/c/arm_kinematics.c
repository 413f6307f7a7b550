/* Forward kinematics, Jacobian and all branches of the inverse kinematics of an arm with five axes.
 *
 * The arm pans about axis 1, bends about the parallel axes 2, 3 and 4 and rolls about axis 5. Poses
 * are turned into those of a canonical arm, whose axes are z, y, y, y and x: {C} is on axis 1 at
 * the height of axis 2, {K} on the roll axis beside the tool. alpha are its angles. Each step of the
 * inverse kinematics is a Paden-Kahan subproblem for these axes:
 *
 *     alpha1  the tool point lies in the arm's plane, which passes beside axis 1 at a distance d
 *     phi     the tool's x axis lies in that plane; the wrist follows from it
 *     alpha3  the wrist's distance from the shoulder, with the elbow up and down
 *     alpha2  the bent arm turns onto the wrist
 *     alpha4  the remainder of phi
 *     alpha5  the tool's y axis
 *
 * Every angle is an atan2 of sides, and differences of squares are factored. Nothing is allocated,
 * and there is no state. Licence: MIT.
 */
#include "kinematics.h"

#include "arm_data.h"

#include <math.h>

static const double PI = 3.14159265358979323846, TAU = 6.28318530717958647693;

/* Excess [rad] over a limit that counts as on it. */
static const double LIMIT_SLACK = 1e-9;

/* [m], [rad] Errors of a pose up to which the arm takes it. */
static const double SAME = 1e-9;

/* [1] Largest deviation from orthonormal of a rotation that is accepted. */
static const double ROTATION_INPUT = 1e-6;

/* [m] A tool point this near to axis 1 is on it. */
static const double ON_AXIS = 1e-9;

/* [1] Cosine of the pitch of the tool up to which its heading is only rounding. */
static const double UPRIGHT = 1e-14;

/* [1, m] Error of a 0 or a 1 after a few products. */
static const double ROUNDING = 1e-15;

/* [1] Fraction of the reach; nearer to axis 1 alpha1 follows from the tool's direction. */
static const double NEAR_AXIS_1 = 1e-3;

/* A plane through axis 1: alpha1, its cosine and sine, and the outward place of the tool point. */
typedef struct {
    double alpha, c, s, u;
} arm_plane;

/* Angles in the plane: phi, alpha2 with the elbow up and down, alpha3 and alpha5. */
typedef struct {
    double phi, up, down, bend, roll;
} arm_posture;

/* T = A B; rows of 4. */
static void multiply(const double A[16], const double B[16], double T[16])
{
    int i, j;
    for (i = 0; i < 4; i++)
        for (j = 0; j < 4; j++)
            T[4 * i + j] = A[4 * i] * B[j] + A[4 * i + 1] * B[4 + j] + A[4 * i + 2] * B[8 + j] +
                           A[4 * i + 3] * B[12 + j];
}

/* exp of the screw of an axis at an angle: I + sin X + (1 - cos) X^2. */
static void turn(int axis, double angle, double T[16])
{
    const double s = sin(angle), half = sin(0.5 * angle), v = 2.0 * half * half;
    int k;
    for (k = 0; k < 16; k++)
        T[k] = s * generators[axis][k] + v * squared_generators[axis][k] + (k % 5 == 0 ? 1.0 : 0.0);
}

void robot_fk(const double q[ROBOT_AXES], double T[16])
{
    double E[16], product[16];
    int axis, k;
    for (k = 0; k < 16; k++)
        T[k] = tool_at_zero[k];
    for (axis = ROBOT_AXES - 1; axis >= 0; axis--) {
        turn(axis, q[axis], E);
        multiply(E, T, product);
        for (k = 0; k < 16; k++)
            T[k] = product[k];
    }
}

void robot_jacobian(const double q[ROBOT_AXES], double J[6][ROBOT_AXES])
{
    double T[16] = {1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0};
    double E[16], product[16], w[3], v[3];
    int axis, i, k;
    for (axis = 0; axis < ROBOT_AXES; axis++) {
        const double *S = screws[axis];
        for (i = 0; i < 3; i++) {
            w[i] = T[4 * i] * S[0] + T[4 * i + 1] * S[1] + T[4 * i + 2] * S[2];
            v[i] = T[4 * i] * S[3] + T[4 * i + 1] * S[4] + T[4 * i + 2] * S[5];
        }
        J[0][axis] = w[0];
        J[1][axis] = w[1];
        J[2][axis] = w[2];
        J[3][axis] = v[0] + T[7] * w[2] - T[11] * w[1];
        J[4][axis] = v[1] + T[11] * w[0] - T[3] * w[2];
        J[5][axis] = v[2] + T[3] * w[1] - T[7] * w[0];
        turn(axis, q[axis], E);
        multiply(T, E, product);
        for (k = 0; k < 16; k++)
            T[k] = product[k];
    }
}

/* The angle in (-pi, pi]. */
static double wrapped(double angle)
{
    angle = remainder(angle, TAU);
    return angle == -PI ? PI : angle;
}

/* The angle in the turn between the limits if there is one, else in (-pi, pi]. */
static double in_turn(double angle, double lower, double upper)
{
    double moved;
    angle = wrapped(angle);
    lower -= LIMIT_SLACK;
    upper += LIMIT_SLACK;
    if (lower <= angle && angle <= upper)
        return angle;
    moved = angle > upper ? floor((upper - angle) / TAU) : ceil((lower - angle) / TAU);
    moved = angle + TAU * moved;
    return lower <= moved && moved <= upper ? moved : angle;
}

static arm_plane plane(double c, double s, double u)
{
    arm_plane found;
    found.alpha = atan2(s, c);
    found.c = c;
    found.s = s;
    found.u = u;
    return found;
}

static double clamped(double value)
{
    return value < -1.0 ? -1.0 : value > 1.0 ? 1.0 : value;
}

/* The planes that face the tool point and face away from it, valid also near axis 1 and near the
 * cylinder of radius d about it. There the tool's x axis determines them, if it is not upright; a
 * tool upright on axis 1 leaves them at `free_angle`. */
static void planes_near_axis_1(const double T[16], double free_angle, arm_plane found[2])
{
    const double x = T[3], y = T[7], d = arm_d, rounding = 2.0 * ROUNDING * arm_reach;
    const double rho = hypot(x, y), flat = hypot(T[0], T[4]);
    double sine, cosine, ex, ey;
    if (flat > UPRIGHT) {
        double c = T[0] / flat, s = T[4] / flat;
        const double trust = flat * arm_reach < ON_AXIS ? flat * arm_reach : ON_AXIS;
        if (fabs(c * y - s * x + d) < fabs(c * y - s * x - d)) {
            c = -c;
            s = -s;
        }
        if (rho <= trust || fabs(c * y - s * x - d) <= rounding) {
            const double u = c * x + s * y;
            double c2 = -c, s2 = -s, scale;
            if (d != 0.0 && rho > ON_AXIS) {
                c2 = d * y - u * x;
                s2 = -d * x - u * y;
                scale = 1.0 / hypot(c2, s2);
                c2 *= scale;
                s2 *= scale;
            }
            found[u < -rounding] = plane(c, s, u);
            found[!(u < -rounding)] = plane(c2, s2, -u);
            return;
        }
    } else if (rho <= 0.5 * rounding) {
        found[0].alpha = wrapped(free_angle);
        found[0].c = cos(found[0].alpha);
        found[0].s = sin(found[0].alpha);
        found[1].alpha = wrapped(found[0].alpha + PI);
        found[1].c = -found[0].c;
        found[1].s = -found[0].s;
        found[0].u = found[1].u = 0.0;
        return;
    }
    sine = clamped(d / rho);
    cosine = sqrt((1.0 - sine) * (1.0 + sine));
    ex = x / rho;
    ey = y / rho;
    found[0] = plane(ex * cosine + ey * sine, ey * cosine - ex * sine, rho * cosine);
    found[1] = plane(ey * sine - ex * cosine, -ey * cosine - ex * sine, -rho * cosine);
}

static arm_posture posture_in(const arm_plane *at, const double T[16])
{
    const double c = at->c, s = at->s;
    const double pitch = atan2(-T[8], c * T[0] + s * T[4]), cp = cos(pitch), sp = sin(pitch);
    const double v = -T[11] - arm_ahead * sp - (ARM_IS_MIRRORED ? 0.0 : arm_below * cp);
    const double u = ARM_IS_MIRRORED ? at->u - arm_ahead * cp
                                     : at->u - arm_a - arm_ahead * cp + arm_below * sp;
    const double square = u * u + v * v, rho = sqrt(square);
    /* By the law of cosines; out of reach one of them is negative. */
    const double stretched = (arm_longest - rho) * (arm_longest + rho);
    const double folded = (rho - arm_shortest) * (rho + arm_shortest);
    const double product = stretched * folded, sine = product > 0.0 ? sqrt(product) : 0.0;
    const double towards = atan2(v, u), beside = atan2(sine, square + arm_squares);
    arm_posture found;
    found.phi = ARM_IS_MIRRORED ? pitch : pitch + arm_tilt;
    found.up = towards - beside;
    found.down = towards + beside;
    found.bend = atan2(2.0 * sine, folded - stretched);
    found.roll = atan2(sp * (c * T[1] + s * T[5]) + cp * T[9],
                       sp * (c * T[2] + s * T[6]) + cp * T[10]);
    return found;
}

static void set(double alpha[5], double one, double two, double three, double four, double five)
{
    alpha[0] = one;
    alpha[1] = two;
    alpha[2] = three;
    alpha[3] = four;
    alpha[4] = five;
}

static double half_turned(double angle)
{
    return angle > 0.0 ? angle - PI : angle + PI;
}

static double within_half_turn(double angle)
{
    return angle >= -PI && angle <= PI ? angle : remainder(angle, TAU);
}

/* Canonical angles of the four branches for the pose T of {K} in {C}. */
static void canonical_branches(const double T[16], double free_angle, double alpha[4][5])
{
    arm_plane planes[2];
    arm_posture p;
    const double u = hypot(T[3], T[7]);
    double a4, b4, other;
    if (arm_d == 0.0 && u > NEAR_AXIS_1 * arm_reach) {
        planes[0].alpha = atan2(T[7], T[3]);
        planes[0].c = T[3] / u;
        planes[0].s = T[7] / u;
        planes[0].u = u;
        planes[1].alpha = half_turned(planes[0].alpha);
    } else
        planes_near_axis_1(T, free_angle, planes);
    p = posture_in(&planes[0], T);
    if (p.up < -PI)
        p.up += TAU;
    if (p.down > PI)
        p.down -= TAU;
    a4 = within_half_turn(p.phi - p.up - p.bend);
    b4 = within_half_turn(p.phi - p.down + p.bend);
    set(alpha[0], planes[0].alpha, p.up, p.bend, a4, p.roll);
    set(alpha[1], planes[0].alpha, p.down, -p.bend, b4, p.roll);
    if (ARM_IS_MIRRORED) {
        /* Half a turn about axis 1 maps the arm's plane to its own mirror image. */
        const double roll = half_turned(p.roll);
        other = planes[1].alpha;
        set(alpha[2], other, p.down > 0.0 ? PI - p.down : -PI - p.down, p.bend, -b4, roll);
        set(alpha[3], other, p.up > 0.0 ? PI - p.up : -PI - p.up, -p.bend, -a4, roll);
        return;
    }
    if (arm_d == 0.0) {
        planes[1].c = -planes[0].c;
        planes[1].s = -planes[0].s;
        planes[1].u = -planes[0].u;
    }
    p = posture_in(&planes[1], T);
    p.up = remainder(p.up, TAU);
    p.down = remainder(p.down, TAU);
    other = planes[1].alpha;
    set(alpha[2], other, p.up, p.bend, remainder(p.phi - p.up - p.bend, TAU), p.roll);
    set(alpha[3], other, p.down, -p.bend, remainder(p.phi - p.down + p.bend, TAU), p.roll);
}

/* Distance [m] and angle [rad] from the pose A to the pose B. */
static void difference(const double A[16], const double B[16], double *distance, double *angle)
{
    double R[9], x, y, z;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            R[3 * i + j] = A[i] * B[j] + A[4 + i] * B[4 + j] + A[8 + i] * B[8 + j];
    x = 0.5 * (R[7] - R[5]);
    y = 0.5 * (R[2] - R[6]);
    z = 0.5 * (R[3] - R[1]);
    *angle = atan2(sqrt(x * x + y * y + z * z), 0.5 * (R[0] + R[4] + R[8] - 1.0));
    x = A[3] - B[3];
    y = A[7] - B[7];
    z = A[11] - B[11];
    *distance = sqrt(x * x + y * y + z * z);
}

/* Errors [m], [rad] of a pose that rounding in the robot's file explains; T of {K} in {C}. */
static void explained(const double T[16], double *length, double *angle)
{
    const double rho = hypot(T[3], T[7]), d = fabs(arm_d);
    double outward;
    *length = *angle = 0.0;
    if (arm_rounding > 0.0) {
        outward = sqrt(fabs(rho - d) * (rho + d) + arm_rounding * (arm_rounding + 2.0 * d));
        *angle = 4.0 * arm_skew + arm_rounding / outward;
        *length = arm_rounding + *angle * arm_off_axis;
    }
}

/* Whether T is finite, its rotation orthonormal and right-handed, and its last row 0 0 0 1. */
static int is_pose(const double T[16])
{
    double worst = 0.0, product;
    int i, j, k;
    for (i = 0; i < 3; i++) {
        for (j = i; j < 3; j++) {
            product = T[i] * T[j] + T[4 + i] * T[4 + j] + T[8 + i] * T[8 + j];
            product = fabs(product - (i == j ? 1.0 : 0.0));
            if (!(product <= worst))
                worst = product;
        }
    }
    for (k = 0; k < 12; k++)
        if (!(fabs(T[k]) <= 1e300))
            return 0;
    product = T[0] * (T[5] * T[10] - T[6] * T[9]) - T[1] * (T[4] * T[10] - T[6] * T[8]) +
              T[2] * (T[4] * T[9] - T[5] * T[8]);
    return worst <= ROTATION_INPUT && product > 0.0 && T[12] == 0.0 && T[13] == 0.0 &&
           T[14] == 0.0 && T[15] == 1.0;
}

int robot_ik(const double T[16], double theta1, robot_solution found[4])
{
    double K[16], product[16], alpha[4][5], reached[16], length, angle;
    int branch, axis, k, count = 0;
    if (!is_pose(T))
        return -1;
    if (ARM_IS_CANONICAL) {
        for (k = 0; k < 16; k++)
            K[k] = T[k];
    } else {
        multiply(canonical_base, T, product);
        multiply(product, canonical_tool, K);
        theta1 *= arm_signs[0];
    }
    canonical_branches(K, theta1, alpha);
    explained(K, &length, &angle);
    for (branch = 0; branch < 4; branch++) {
        robot_solution *each = &found[branch];
        each->within_limits = 1;
        for (axis = 0; axis < ROBOT_AXES; axis++) {
            double q = alpha[branch][axis];
            if (!ARM_IS_DIRECT)
                q = in_turn(arm_signs[axis] * (q - arm_shifts[axis]), arm_lower[axis],
                            arm_upper[axis]);
            each->q[axis] = q;
            if (!(q >= arm_lower[axis] - LIMIT_SLACK && q <= arm_upper[axis] + LIMIT_SLACK))
                each->within_limits = 0;
        }
        robot_fk(each->q, reached);
        difference(reached, T, &each->position_error, &each->rotation_error);
        each->exact = each->position_error <= SAME + length && each->rotation_error <= SAME + angle;
        count += each->exact && each->within_limits;
    }
    return count;
}
