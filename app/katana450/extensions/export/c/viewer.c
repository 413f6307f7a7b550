/* Shows the robot and moves its joints. Licence: MIT.
 *
 *   viewer [--pose Q,Q,...] [--follow PORT] [--size WIDTHxHEIGHT]
 *          [--screenshot FILE.ppm | --frames COUNT]
 *
 *   --pose        values of the joints at the start, rad or m
 *   --follow      show the arm of `katana450 serve --lines PORT` of this machine
 *   --screenshot  write one picture and exit; with --follow, the picture of the first state
 *   --frames      draw COUNT pictures at maximum speed, print the frame rate and exit
 *
 * Keys: 1 to 9 select a joint; +, - and the arrows left and right move it; 0 resets all joints,
 * c resets the camera, p writes the picture viewer.ppm, Esc exits. Mouse: drag with the left button
 * to rotate the view, with Shift to move the selected joint; drag with the right button or turn
 * the wheel to zoom.
 */
#define _POSIX_C_SOURCE 200112L

#include "robot.h"

#include <GL/freeglut.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef _WIN32
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#endif

static const double PI = 3.14159265358979323846;

enum {
    LINE = 65536,      /* maximum bytes of a state */
    AGAIN = 1000,      /* ms between attempts to connect */
    FIRST_STATE = 5000 /* ms, timeout of a screenshot */
};

static double q[ROBOT_JOINTS + 1];
static double start[ROBOT_JOINTS + 1];
static int chosen;

static double azimuth, elevation, distance;
static int width = 800, height = 800;
static int held = -1, held_with_shift, last_x, last_y;

static const char *screenshot;
static int frames;
static int wanted; /* a key has requested a picture */

static int port;
static int link_socket = -1;
static int asked_at;
static int states;

/* Camera and joints ------------------------------------------------------- */

static void reset_camera(void)
{
    double way[3];
    int k;
    for (k = 0; k < 3; k++)
        way[k] = robot_eye[k] - robot_target[k];
    distance = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
    azimuth = atan2(way[1], way[0]);
    elevation = asin(way[2] / distance);
}

static double clamped(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

static void move_chosen(double by)
{
    const robot_joint *joint = &robot_joints[chosen];
    if (ROBOT_JOINTS > 0)
        q[chosen] = clamped(q[chosen] + (joint->slides ? 0.1 * by : by), joint->lower, joint->upper);
}

/* Pictures ---------------------------------------------------------------- */

static void write_text(int x, int y, const char *text)
{
    glRasterPos2i(x, y);
    glutBitmapString(GLUT_BITMAP_HELVETICA_12, (const unsigned char *)text);
}

static void write_words(void)
{
    char text[160];
    glMatrixMode(GL_PROJECTION);
    glLoadIdentity();
    glOrtho(0.0, width, 0.0, height, -1.0, 1.0);
    glMatrixMode(GL_MODELVIEW);
    glLoadIdentity();
    glDisable(GL_LIGHTING);
    glDisable(GL_DEPTH_TEST);
    glColor3f(0.15f, 0.17f, 0.2f);
    if (ROBOT_JOINTS > 0) {
        const robot_joint *joint = &robot_joints[chosen];
        snprintf(text, sizeof text, "%d  %s  %.3f %s", chosen + 1, joint->name, q[chosen],
                 joint->slides ? "m" : "rad");
        write_text(12, 30, text);
    }
    if (port > 0) {
        snprintf(text, sizeof text, "%s port %d",
                 link_socket >= 0 && states > 0 ? "following" : "no server at", port);
        write_text(12, 12, text);
    }
    glEnable(GL_DEPTH_TEST);
    glEnable(GL_LIGHTING);
}

/* Everything except the texts. */
static void draw(void)
{
    static const float ahead[4] = {0.0f, 0.0f, 1.0f, 0.0f}, above[4] = {0.3f, -0.4f, 1.0f, 0.0f};
    static const float bright[4] = {0.55f, 0.55f, 0.55f, 1.0f};
    double c = cos(elevation);

    glViewport(0, 0, width, height);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glMatrixMode(GL_PROJECTION);
    glLoadIdentity();
    gluPerspective(robot_field_of_view * 180.0 / PI, (double)width / height, 0.02 * distance,
                   20.0 * distance);
    glMatrixMode(GL_MODELVIEW);
    glLoadIdentity();
    glLightfv(GL_LIGHT0, GL_POSITION, ahead);
    gluLookAt(robot_target[0] + distance * c * cos(azimuth),
              robot_target[1] + distance * c * sin(azimuth),
              robot_target[2] + distance * sin(elevation), robot_target[0], robot_target[1],
              robot_target[2], 0.0, 0.0, 1.0);
    glLightfv(GL_LIGHT1, GL_POSITION, above);
    glLightfv(GL_LIGHT0, GL_DIFFUSE, bright);
    glLightfv(GL_LIGHT1, GL_DIFFUSE, bright);
    robot_draw(q);
}

/* Reads the back buffer. */
static int write_picture(const char *name)
{
    size_t row = 3 * (size_t)width;
    unsigned char *pixels = (unsigned char *)malloc(row * (size_t)height);
    FILE *file = fopen(name, "wb");
    int y, whole = pixels != NULL && file != NULL;
    if (whole) {
        glPixelStorei(GL_PACK_ALIGNMENT, 1);
        glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, pixels);
        whole = fprintf(file, "P6\n%d %d\n255\n", width, height) > 0;
        for (y = height - 1; y >= 0 && whole; y--)
            whole = fwrite(pixels + (size_t)y * row, 1, row, file) == row;
    }
    if (file != NULL && fclose(file) != 0)
        whole = 0;
    free(pixels);
    if (!whole)
        fprintf(stderr, "viewer: %s cannot be written.\n", name);
    return whole;
}

static void measure(void)
{
    int k, begin;
    draw();
    glFinish();
    begin = glutGet(GLUT_ELAPSED_TIME);
    for (k = 0; k < frames; k++) {
        azimuth += 2.0 * PI / frames;
        draw();
        write_words();
        glutSwapBuffers();
        glFinish();
    }
    printf("%.1f frames/s\n", 1000.0 * frames / (glutGet(GLUT_ELAPSED_TIME) - begin + 1e-9));
}

static void display(void)
{
    if (screenshot != NULL) {
        if (port > 0 && states == 0)
            return;
        draw();
        exit(write_picture(screenshot) ? EXIT_SUCCESS : EXIT_FAILURE);
    }
    if (frames > 0) {
        measure();
        exit(EXIT_SUCCESS);
    }
    draw();
    if (wanted) {
        wanted = 0;
        write_picture("viewer.ppm");
    }
    write_words();
    glutSwapBuffers();
}

/* The server: JSON, one object per line --------------------------------------- */

/* The text behind "key": or NULL. Keys of the server's states have no escapes. */
static const char *behind(const char *line, const char *key)
{
    char wanted[32];
    const char *found;
    snprintf(wanted, sizeof wanted, "\"%s\":", key);
    found = strstr(line, wanted);
    return found == NULL ? NULL : found + strlen(wanted);
}

static void take_state(const char *line)
{
    const char *is = behind(line, "is"), *at = behind(line, "q"), *gripper = behind(line, "gripper");
    double heard[ROBOT_JOINTS + 1];
    char *end;
    int count = 0, k;
    if (is == NULL || strncmp(is, "\"state\"", 7) != 0 || at == NULL || *at != '[')
        return;
    while (count < ROBOT_JOINTS && (*at == '[' || *at == ',')) {
        heard[count] = strtod(at + 1, &end);
        if (end == at + 1)
            return;
        count++;
        at = end;
    }
    if (*at != ']')
        return;
    if (count < ROBOT_JOINTS && gripper != NULL)
        heard[count++] = strtod(gripper, NULL);
    for (k = 0; k < count; k++)
        q[k] = heard[k];
    states++;
    glutPostRedisplay();
}

#ifdef _WIN32

static void follow(void)
{
}

#else

static void hang_up(void)
{
    close(link_socket);
    link_socket = -1;
    glutPostRedisplay();
}

static void call(void)
{
    static const char words[] =
        "{\"do\":\"hello\",\"name\":\"OpenGL viewer\"}\n{\"do\":\"watch\",\"hz\":50}\n";
    struct sockaddr_in address;
    asked_at = glutGet(GLUT_ELAPSED_TIME);
    memset(&address, 0, sizeof address);
    address.sin_family = AF_INET;
    address.sin_port = htons((unsigned short)port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    link_socket = socket(AF_INET, SOCK_STREAM, 0);
    if (link_socket < 0)
        return;
    if (connect(link_socket, (const struct sockaddr *)&address, sizeof address) != 0 ||
        send(link_socket, words, sizeof words - 1, MSG_NOSIGNAL) != (ssize_t)sizeof words - 1 ||
        fcntl(link_socket, F_SETFL, O_NONBLOCK) != 0)
        hang_up();
}

static void follow(void)
{
    static char line[LINE];
    static size_t filled;
    static int too_long;
    ssize_t got;
    char *end;
    if (link_socket < 0) {
        if (asked_at != 0 && glutGet(GLUT_ELAPSED_TIME) - asked_at < AGAIN)
            return;
        filled = 0;
        too_long = 0;
        call();
        if (link_socket < 0)
            return;
    }
    while ((got = recv(link_socket, line + filled, sizeof line - 1 - filled, 0)) > 0) {
        filled += (size_t)got;
        line[filled] = '\0';
        while ((end = (char *)memchr(line, '\n', filled)) != NULL) {
            *end = '\0';
            if (!too_long)
                take_state(line);
            too_long = 0;
            filled -= (size_t)(end + 1 - line);
            memmove(line, end + 1, filled + 1);
        }
        if (filled == sizeof line - 1) {
            filled = 0;
            too_long = 1;
        }
    }
    if (got == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR))
        hang_up();
}

#endif

static void tick(int unused)
{
    follow();
    if (screenshot != NULL && states == 0 && glutGet(GLUT_ELAPSED_TIME) > FIRST_STATE) {
        fprintf(stderr, "viewer: no server answers at port %d.\n", port);
        exit(EXIT_FAILURE);
    }
    glutTimerFunc(15, tick, unused);
}

/* Keys and mouse ---------------------------------------------------------- */

static void key(unsigned char sign, int x, int y)
{
    (void)x;
    (void)y;
    if (sign == 27)
        exit(EXIT_SUCCESS);
    if (sign >= '1' && sign <= '9' && sign - '1' < ROBOT_JOINTS)
        chosen = sign - '1';
    else if (sign == '+' || sign == '=')
        move_chosen(0.05);
    else if (sign == '-')
        move_chosen(-0.05);
    else if (sign == '0')
        memcpy(q, start, sizeof q);
    else if (sign == 'c')
        reset_camera();
    else if (sign == 'p')
        wanted = 1;
    glutPostRedisplay();
}

static void arrow(int which, int x, int y)
{
    (void)x;
    (void)y;
    if (which == GLUT_KEY_LEFT)
        move_chosen(-0.05);
    else if (which == GLUT_KEY_RIGHT)
        move_chosen(0.05);
    glutPostRedisplay();
}

static void come_nearer(double by)
{
    distance = clamped(distance * exp(-by), 0.01, 1000.0);
}

static void button(int which, int state, int x, int y)
{
    held = state == GLUT_DOWN ? which : -1;
    held_with_shift = glutGetModifiers() & GLUT_ACTIVE_SHIFT;
    last_x = x;
    last_y = y;
    if (state == GLUT_DOWN && (which == 3 || which == 4))
        come_nearer(which == 3 ? 0.1 : -0.1);
    glutPostRedisplay();
}

static void drag(int x, int y)
{
    double dx = x - last_x, dy = y - last_y;
    last_x = x;
    last_y = y;
    if (held == GLUT_LEFT_BUTTON && held_with_shift) {
        move_chosen(0.01 * dx);
    } else if (held == GLUT_LEFT_BUTTON) {
        azimuth -= 0.01 * dx;
        elevation = clamped(elevation + 0.01 * dy, -1.55, 1.55);
    } else if (held == GLUT_RIGHT_BUTTON) {
        come_nearer(0.01 * dy);
    }
    glutPostRedisplay();
}

static void resize(int w, int h)
{
    width = w > 0 ? w : 1;
    height = h > 0 ? h : 1;
}

/* Command line ------------------------------------------------------------ */

static void refuse(const char *what)
{
    fprintf(stderr, "viewer: %s. The options are described at the top of viewer.c.\n", what);
    exit(2);
}

static void read_pose(const char *text)
{
    char *end;
    int k;
    for (k = 0; *text != '\0'; k++) {
        double value = strtod(text, &end);
        if (end == text || (*end != ',' && *end != '\0'))
            refuse("--pose needs comma-separated numbers");
        if (k >= ROBOT_JOINTS)
            refuse("--pose has more numbers than the robot has joints");
        if (!(value >= robot_joints[k].lower && value <= robot_joints[k].upper))
            refuse("--pose is outside the limits of a joint");
        start[k] = value;
        text = *end == ',' ? end + 1 : end;
    }
}

static void read_words(int count, char **words)
{
    int k;
    for (k = 1; k + 1 < count; k += 2) {
        const char *value = words[k + 1];
        if (strcmp(words[k], "--pose") == 0)
            read_pose(value);
        else if (strcmp(words[k], "--screenshot") == 0)
            screenshot = value;
        else if (strcmp(words[k], "--frames") == 0)
            frames = atoi(value);
        else if (strcmp(words[k], "--follow") == 0)
            port = atoi(value);
        else if (strcmp(words[k], "--size") == 0) {
            if (sscanf(value, "%dx%d", &width, &height) != 2 || width < 1 || height < 1)
                refuse("--size needs WIDTHxHEIGHT");
        } else
            refuse(words[k]);
    }
    if (k < count)
        refuse(words[k]);
#ifdef _WIN32
    if (port != 0)
        refuse("--follow is not supported on Windows");
#endif
    if (port < 0 || port > 65535)
        refuse("--follow needs a port from 1 to 65535");
}

int main(int count, char **words)
{
    int name_alone = 1;
    memcpy(start, robot_start, sizeof start);
    /* Before the screen is opened, so that options are refused without one too. */
    read_words(count, words);
    glutInit(&name_alone, words);
    memcpy(q, start, sizeof q);
    reset_camera();
    glutInitDisplayMode(GLUT_DOUBLE | GLUT_RGB | GLUT_DEPTH);
    glutInitWindowSize(width, height);
    glutCreateWindow(ROBOT_NAME);
    glClearColor(0.87f, 0.89f, 0.92f, 1.0f);
    glEnable(GL_DEPTH_TEST);
    glEnable(GL_CULL_FACE);
    glEnable(GL_LIGHTING);
    glEnable(GL_LIGHT0);
    glEnable(GL_LIGHT1);
    glutDisplayFunc(display);
    glutReshapeFunc(resize);
    glutKeyboardFunc(key);
    glutSpecialFunc(arrow);
    glutMouseFunc(button);
    glutMotionFunc(drag);
    if (port > 0)
        tick(0);
    glutMainLoop();
    return EXIT_SUCCESS;
}
