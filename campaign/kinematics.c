// SPDX-License-Identifier: MIT
#include "campaign/kinematics.h"

#include "base/units.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

enum { N = KINEMATICS_COORDINATES, THETA_I = 0, THETA_R = 1 };

#define SINGULAR 1e-9 // a pivot relative to the largest coefficient

const char *const kinematics_kinds[] = {"linear", "spherical", NULL};
const char *const kinematics_coordinates[] = {"theta_i",   "theta_r",  "phi",
                                              "polariser", "analyser", NULL};

static void list(const struct kinematics_pose *pose, double ret_of[N])
{
    const double of[N] = {pose->theta_i, pose->theta_r, pose->phi, pose->polariser, pose->analyser};
    memcpy(ret_of, of, sizeof of);
}

static void forget(double at[KINEMATICS_AXES])
{
    for (int i = 0; i < KINEMATICS_AXES; i++)
        at[i] = (double)NAN;
}

// --- linear: making it ---------------------------------------------------------------------------

static int find_moved(const struct kinematics_row *rows, int count, struct kinematics *k)
{
    int moved = 0;
    for (int c = 0; c < N; c++) {
        bool used = false;
        for (int r = 0; r < count; r++)
            used = used || rows[r].of[c] != 0;
        if (used)
            k->coordinate[moved++] = c;
    }
    return moved;
}

// Gauss-Jordan with the largest pivot of a column; false when there is none worth the name. The
// inverse of a matrix of ones and zeros is exact.
static bool invert(double a[N][N], double inverse[N][N], int n)
{
    double largest = 0;
    for (int r = 0; r < n; r++)
        for (int c = 0; c < n; c++) {
            inverse[r][c] = r == c;
            largest = fmax(largest, fabs(a[r][c]));
        }
    for (int c = 0; c < n; c++) {
        int pivot = c;
        for (int r = c + 1; r < n; r++)
            if (fabs(a[r][c]) > fabs(a[pivot][c]))
                pivot = r;
        if (fabs(a[pivot][c]) <= SINGULAR * largest)
            return false;
        for (int j = 0; j < n; j++) {
            const double x = a[c][j], y = inverse[c][j];
            a[c][j] = a[pivot][j], inverse[c][j] = inverse[pivot][j];
            a[pivot][j] = x, inverse[pivot][j] = y;
        }
        const double scale = a[c][c];
        for (int j = 0; j < n; j++)
            a[c][j] /= scale, inverse[c][j] /= scale;
        for (int r = 0; r < n; r++) {
            const double by = a[r][c];
            for (int j = 0; j < n && r != c && by != 0; j++)
                a[r][j] -= by * a[c][j], inverse[r][j] -= by * inverse[c][j];
        }
    }
    return true;
}

static void name_moved(const struct kinematics *k, char *text, size_t size)
{
    *text = 0;
    for (int c = 0; c < k->count; c++) {
        const size_t used = strlen(text);
        snprintf(text + used, size - used, "%s%s", c ? ", " : "",
                 kinematics_coordinates[k->coordinate[c]]);
    }
}

int kinematics_linear(const struct kinematics_row *rows, int count,
                      struct kinematics *ret_kinematics, struct gon_error *err)
{
    struct kinematics k = {.kind = KINEMATICS_LINEAR};
    double scratch[N][N];
    char names[80];
    k.count = find_moved(rows, count, &k);
    for (int c = 0; c < 2; c++)
        if (k.count <= c || k.coordinate[c] != c)
            return gon_fail(err, GON_E_INPUT, "no row has a coefficient for %s",
                            kinematics_coordinates[c]);
    name_moved(&k, names, sizeof names);
    if (k.count != count)
        return gon_fail(err, GON_E_INPUT,
                        "%d row%s for %d coordinates (%s): as many axes as coordinates are wanted",
                        count, count == 1 ? "" : "s", k.count, names);
    for (int r = 0; r < count; r++) {
        k.axis[r] = rows[r].axis;
        k.offset[r] = rows[r].offset;
        for (int c = 0; c < k.count; c++)
            scratch[r][c] = k.matrix[r][c] = rows[r].of[k.coordinate[c]];
    }
    if (!invert(scratch, k.inverse, count))
        return gon_fail(err, GON_E_INPUT,
                        "singular: the axes' positions do not tell %s apart; one row is a "
                        "combination of others",
                        names);
    *ret_kinematics = k;
    return GON_OK;
}

// --- linear: using it ----------------------------------------------------------------------------

// -0.0 is what changes no number when it is added to it, so that 1 x theta_i is theta_i to the bit.
static double product(const double row[N], const double x[N], int n)
{
    double sum = -0.0;
    for (int c = 0; c < n; c++)
        if (row[c] != 0)
            sum += row[c] * x[c];
    return sum;
}

static int linear_inverse(const struct kinematics *k, const struct kinematics_pose *pose,
                          double ret_at[KINEMATICS_AXES], struct gon_error *err)
{
    double of[N], moved[N] = {0};
    list(pose, of);
    for (int c = 0; c < k->count; c++) {
        moved[c] = of[k->coordinate[c]];
        of[k->coordinate[c]] = 0;
    }
    for (int c = 0; c < N; c++)
        if (!isnan(of[c]) && of[c] != 0)
            return gon_fail(err, GON_E_INPUT, "%s = %.9g deg: no axis of this bench moves it",
                            kinematics_coordinates[c], of[c]);
    forget(ret_at);
    for (int r = 0; r < k->count; r++) {
        const double at = product(k->matrix[r], moved, k->count);
        ret_at[k->axis[r]] = k->offset[r] != 0 ? at + k->offset[r] : at;
    }
    return GON_OK;
}

static struct kinematics_pose linear_forward(const struct kinematics *k,
                                             const double at[KINEMATICS_AXES])
{
    double of[N] = {0}, x[N];
    for (int r = 0; r < k->count; r++)
        x[r] = at[k->axis[r]] - k->offset[r];
    for (int c = 0; c < k->count; c++)
        of[k->coordinate[c]] = product(k->inverse[c], x, k->count);
    return (struct kinematics_pose){of[0], of[1], of[2], of[3], of[4]};
}

// --- spherical -----------------------------------------------------------------------------------

struct kinematics kinematics_spherical(const struct kinematics_roles *roles)
{
    return (struct kinematics){.kind = KINEMATICS_SPHERICAL, .roles = *roles};
}

static double atan2_deg(double y, double x)
{
    return units_deg(atan2(y, x));
}

// w of the header: from y to s about the arm.
static double analyser_turn_deg(double tilt, double azimuth, double arm, double phi)
{
    const double t = units_rad(tilt), u = units_rad(azimuth), a = units_rad(arm),
                 f = units_rad(phi);
    const double along_y = cos(f) * cos(u) - sin(f) * cos(t) * sin(u);
    const double across =
        sin(f) * (sin(t) * sin(a) + cos(t) * cos(u) * cos(a)) + cos(f) * sin(u) * cos(a);
    return atan2_deg(across, along_y);
}

static int check_pose(const struct kinematics *k, const struct kinematics_pose *p,
                      struct gon_error *err)
{
    if (!(p->theta_i >= 0 && p->theta_i < 90))
        return gon_fail(err, GON_E_INPUT,
                        "theta_i = %.9g deg: the light would not fall on the sample's face; "
                        "allowed 0..90 deg",
                        p->theta_i);
    if (!(fabs(p->theta_r) < 90))
        return gon_fail(err, GON_E_INPUT,
                        "theta_r = %.9g deg: the detector would be behind the sample's face; "
                        "allowed -90..90 deg",
                        p->theta_r);
    if (!(p->phi > -90 && p->phi <= 90))
        return gon_fail(err, GON_E_INPUT,
                        "phi = %.9g deg: allowed -90..90 deg; beyond, turn phi by 180 deg and "
                        "change the sign of theta_r",
                        p->phi);
    if (!isnan(p->polariser) && k->roles.polariser < 0)
        return gon_fail(err, GON_E_INPUT, "polariser = %.9g deg: no axis of this bench turns it",
                        p->polariser);
    if (!isnan(p->analyser) && k->roles.analyser < 0)
        return gon_fail(err, GON_E_INPUT, "analyser = %.9g deg: no axis of this bench turns it",
                        p->analyser);
    return GON_OK;
}

static int spherical_inverse(const struct kinematics *k, const struct kinematics_pose *pose,
                             double ret_at[KINEMATICS_AXES], struct gon_error *err)
{
    int rc = check_pose(k, pose, err);
    if (rc < 0)
        return rc;
    const double t = units_rad(pose->theta_i), r = units_rad(pose->theta_r),
                 f = units_rad(pose->phi);
    const double along_e = sin(t) * cos(r) + cos(t) * sin(r) * cos(f);
    const double along_f = -sin(r) * sin(f);
    const double along_z = cos(t) * cos(r) - sin(t) * sin(r) * cos(f);
    const double side = along_e < 0 ? -1 : 1;
    const bool in_plane = pose->phi == 0; // to the last bit what a detector arm does
    const double arm = in_plane ? pose->theta_i + pose->theta_r
                                : side * atan2_deg(hypot(along_e, along_f), along_z);
    const double azimuth =
        in_plane || along_f == 0 ? 0.0 : atan2_deg(side * along_f, side * along_e);
    forget(ret_at);
    ret_at[k->roles.tilt] = pose->theta_i;
    ret_at[k->roles.azimuth] = azimuth;
    ret_at[k->roles.arm] = arm;
    if (k->roles.polariser >= 0)
        ret_at[k->roles.polariser] = pose->polariser - azimuth;
    if (k->roles.analyser >= 0)
        ret_at[k->roles.analyser] =
            pose->analyser + analyser_turn_deg(pose->theta_i, azimuth, arm, pose->phi);
    return GON_OK;
}

// sin theta_r cos phi, sin theta_r sin phi, cos theta_r.
static void direction(double tilt, double azimuth, double arm, double ret_d[3])
{
    const double t = units_rad(tilt), u = units_rad(azimuth), a = units_rad(arm);
    ret_d[0] = cos(t) * sin(a) * cos(u) - sin(t) * cos(a);
    ret_d[1] = -sin(a) * sin(u);
    ret_d[2] = cos(t) * cos(a) + sin(t) * sin(a) * cos(u);
}

// A tilt below 0 is the same place with the azimuth turned by 180 deg: theta_i is its amount, and
// forward is on the other side.
static struct kinematics_pose spherical_forward(const struct kinematics *k,
                                                const double at[KINEMATICS_AXES])
{
    const double tilt = fabs(at[k->roles.tilt]), arm = at[k->roles.arm];
    const double azimuth = at[k->roles.azimuth] + (at[k->roles.tilt] < 0 ? 180 : 0);
    double d[3];
    direction(tilt, azimuth, arm, d);
    struct kinematics_pose p = {.theta_i = tilt, .polariser = 0, .analyser = 0};
    const double side = d[0] < 0 || (d[0] == 0 && d[1] < 0) ? -1 : 1;
    const bool in_plane = azimuth == 0 && fabs(arm - tilt) <= 180;
    p.theta_r = in_plane ? arm - tilt : side * atan2_deg(hypot(d[0], d[1]), d[2]);
    p.phi = in_plane || d[1] == 0 ? 0.0 : atan2_deg(side * d[1], side * d[0]);
    if (k->roles.polariser >= 0)
        p.polariser = at[k->roles.polariser] + azimuth;
    if (k->roles.analyser >= 0)
        p.analyser = at[k->roles.analyser] - analyser_turn_deg(tilt, azimuth, arm, p.phi);
    if (isnan(tilt + azimuth + arm))
        p.theta_r = p.phi = (double)NAN;
    return p;
}

// --- both ----------------------------------------------------------------------------------------

int kinematics_inverse(const struct kinematics *k, const struct kinematics_pose *pose,
                       double ret_at[KINEMATICS_AXES], struct gon_error *err)
{
    return k->kind == KINEMATICS_SPHERICAL ? spherical_inverse(k, pose, ret_at, err)
                                           : linear_inverse(k, pose, ret_at, err);
}

struct kinematics_pose kinematics_forward(const struct kinematics *k,
                                          const double at[KINEMATICS_AXES])
{
    return k->kind == KINEMATICS_SPHERICAL ? spherical_forward(k, at) : linear_forward(k, at);
}

bool kinematics_steers(const struct kinematics *k, int axis)
{
    const struct kinematics_roles *o = &k->roles;
    if (k->kind == KINEMATICS_SPHERICAL)
        return axis == o->tilt || axis == o->azimuth || axis == o->arm;
    for (int r = 0; r < k->count; r++)
        if (k->axis[r] == axis)
            return k->inverse[THETA_I][r] != 0 || k->inverse[THETA_R][r] != 0;
    return false;
}

static struct kinematics_reach spherical_reach(const struct kinematics *k,
                                               const double at[KINEMATICS_AXES],
                                               const double half[KINEMATICS_AXES])
{
    const struct kinematics_roles *o = &k->roles;
    const struct kinematics_pose p = spherical_forward(k, at);
    const double turn = half[o->tilt] + half[o->azimuth] + half[o->arm]; // n against d, at most
    const bool in_plane = at[o->azimuth] == 0 && half[o->azimuth] == 0;
    double d[3];
    direction(at[o->tilt], at[o->azimuth], at[o->arm], d);
    return (struct kinematics_reach){
        .theta_i = p.theta_i,
        .theta_r = p.theta_r,
        .half_theta_i = half[o->tilt],
        .half_theta_r = turn,
        // forward and back change places where the tilt or cos phi passes 0
        .mirrored =
            fabs(at[o->tilt]) < half[o->tilt] || (!in_plane && fabs(d[0]) <= units_rad(turn)),
    };
}

struct kinematics_reach kinematics_reach(const struct kinematics *k,
                                         const double at[KINEMATICS_AXES],
                                         const double half[KINEMATICS_AXES])
{
    if (k->kind == KINEMATICS_SPHERICAL)
        return spherical_reach(k, at, half);
    const struct kinematics_pose p = linear_forward(k, at);
    struct kinematics_reach reach = {.theta_i = p.theta_i, .theta_r = p.theta_r};
    for (int r = 0; r < k->count; r++) {
        if (k->inverse[THETA_I][r] != 0)
            reach.half_theta_i += fabs(k->inverse[THETA_I][r]) * half[k->axis[r]];
        if (k->inverse[THETA_R][r] != 0)
            reach.half_theta_r += fabs(k->inverse[THETA_R][r]) * half[k->axis[r]];
    }
    return reach;
}
