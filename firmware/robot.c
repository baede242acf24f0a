#include "robot.h"

#include <avr/io.h>
#include <string.h>

#include "analog.h"
#include "board.h"
#include "clock.h"
#include "codec.h"
#include "deadman.h"
#include "encoders.h"
#include "link.h"
#include "motors.h"
#include "reset.h"
#include "settings.h"
#include "speed.h"
#include "store.h"
#include "telemetry.h"

#define VERSION_MAJOR 0
#define VERSION_MINOR 1
#define VERSION_PATCH 0
#define LIGHT_PIN 13
/* A wheel without an edge for this many loop periods stands still: 300 ms. */
#define REST_PERIODS (300 / SPEED_PERIOD_MS)
/* The button must be seen for this long, so that a spike of the motors is no press. */
#define PRESS_MS 3

static deadman_t deadman;
static settings_t settings;
static uint32_t settings_mark; /* checksum of the settings in use; 0 without */
static speed_t wheels[2];
static speed_own_t gains[2];
static speed_common_t common;
static ticks_t limit; /* of the dead-man, ticks */
static uint8_t faults, period_ms, press_ms, rest;
static pin_t button;

static void release(void)
{
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        speed_stop(&wheels[wheel]);
        encoders_forget(wheel);
        motors_set(wheel, 0);
    }
}

static void use(void)
{
    settings_mark = codec_check(&settings, sizeof settings);
    limit = (ticks_t)settings.deadman * TICKS_PER_MS;
    memcpy(gains, &settings.left_start, sizeof gains); /* both wheels' own, in this order */
    common.proportional = settings.proportional;
    common.integral = settings.integral;
    common.pitch = speed_pitch(settings.slots);
    motors_configure(&settings);
    encoders_configure(&settings);
    analog_configure(&settings);
    telemetry_configure(&settings);
    if (!board_input(settings.button, &button))
        button.mask = 0;
    link_baud(1, settings.baud);
    faults = 0;
    release();
    deadman_ready(&deadman);
}

/* What becomes of new settings: a refusal, and the field that is to blame. */
static uint8_t take(uint8_t link, const settings_t *wanted, uint8_t *field)
{
    *field = 0;
    if (!deadman_allows(&deadman, link))
        return REFUSAL_OWNED;
    if (settings_mark != 0) {
        if (memcmp(wanted, &settings, sizeof settings) == 0)
            return REFUSAL_NONE;
        if (rest < REST_PERIODS)
            return REFUSAL_MOVING;
    }
    uint8_t refusal = settings_check(wanted, field);
    if (refusal != REFUSAL_NONE)
        return refusal;
    store_begin(wanted);
    settings = *wanted;
    use();
    return REFUSAL_NONE;
}

static void answer(uint8_t link, const void *payload)
{
    uint8_t field;
    answer_t frame = {.type = TYPE_ANSWER};
    frame.refusal = take(link, payload, &field);
    frame.field = field;
    frame.settings = settings_mark;
    link_send(link, &frame, sizeof frame);
}

static void hello(uint8_t link)
{
    hello_t frame = {
        .type = TYPE_HELLO, .version = PROTOCOL_VERSION,
        .major = VERSION_MAJOR, .minor = VERSION_MINOR, .patch = VERSION_PATCH,
    };
    frame.boot = reset_boot();
    frame.board = board_code;
    frame.reset = reset_cause;
    frame.mode = deadman.mode;
    frame.uart = link;
    frame.settings = settings_mark;
    link_send(link, &frame, sizeof frame);
}

void robot_start(void)
{
    uint8_t field;
    deadman_begin(&deadman);
    if (store_load(&settings) && settings_check(&settings, &field) == REFUSAL_NONE)
        use();
    link_tick();
    for (uint8_t link = 0; link < LINKS; link++)
        hello(link); /* a host that was driving learns at once that the board has restarted */
}

/* A command and a duty frame have the same shape. */
static void drive(uint8_t link, const command_t *frame)
{
    uint8_t mode = frame->type == TYPE_DUTY ? MODE_DUTY : MODE_SPEED;
    bool changes = deadman.mode != mode;
    if (!deadman_command(&deadman, link, mode, frame->sequence, clock_now()))
        return;
    if (changes)
        release();
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        int16_t wanted = wheel ? frame->right : frame->left;
        speed_edges_t edges = encoders_edges(wheel);
        encoders_face(wheel, wanted);
        if (mode == MODE_DUTY) {
            wheels[wheel].duty = wanted;
        } else {
            speed_command(&wheels[wheel], &gains[wheel], &common, &edges, wanted);
            if (edges.edges == 0)
                encoders_forget(wheel);
        }
        motors_set(wheel, wheels[wheel].duty);
    }
}

/* Pin 13 is the light only as long as the settings leave it free. */
static void light(uint8_t how)
{
    pin_t pin;
    if (memchr(&settings.left_enable, LIGHT_PIN, &settings.range - &settings.left_enable))
        return;
    board_pin(LIGHT_PIN, &pin);
    bool lit = how == 2 ? !(pin.port[2] & pin.mask) : how;
    pin.port[1] |= pin.mask;
    pin.port[2] &= (uint8_t)~pin.mask;
    if (lit)
        pin.port[2] |= pin.mask;
}

static void act(uint8_t link, const action_t *frame)
{
    if (frame->action == ACTION_LIGHT)
        light(frame->value);
    if (!deadman_allows(&deadman, link))
        return;
    if (frame->action == ACTION_CLEAR) {
        faults = 0;
        deadman_clear(&deadman);
    }
    if (frame->action == ACTION_CAPTURE)
        telemetry_capture(frame->value);
}

void robot_obey(uint8_t link, const void *payload)
{
    const stop_t *frame = payload; /* type and sequence stand alike in every frame to the board */
    switch (frame->type) {
    case TYPE_COMMAND:
    case TYPE_DUTY:
        drive(link, payload);
        break;
    case TYPE_STOP:
        release();
        deadman_stop(&deadman, link, frame->sequence, clock_now());
        break;
    case TYPE_ASK:
        hello(link);
        break;
    case TYPE_ACTION:
        act(link, payload);
        break;
    case TYPE_SETTINGS:
        answer(link, payload);
        break;
    default:
        break; /* frames of a board: a line that echoes */
    }
}

static void check_button(void)
{
    bool pressed = false;
    if (button.mask) {
        bool high = *button.port & button.mask;
        pressed = high == settings.button_high;
    }
    if (!pressed)
        press_ms = 0;
    else if (press_ms < PRESS_MS)
        press_ms++;
    deadman_button(&deadman, press_ms == PRESS_MS);
}

static void loop(void)
{
    if (rest < REST_PERIODS)
        rest++;
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        speed_t *speed = &wheels[wheel];
        bool edge = encoders_moved(wheel);
        if (deadman.mode == MODE_SPEED) {
            speed_edges_t edges = encoders_edges(wheel);
            speed_step(speed, &gains[wheel], &common, &edges);
            motors_set(wheel, speed->duty);
        }
        if (edge || speed->duty != 0)
            rest = 0;
        if (speed_stalled(speed, edge)) {
            faults |= (uint8_t)(1 << wheel);
            deadman_fault(&deadman);
        }
    }
}

void robot_tick(void)
{
    bool drove = deadman_drives(&deadman);
    check_button();
    deadman_tick(&deadman, limit, clock_now());
    if (++period_ms == SPEED_PERIOD_MS) {
        period_ms = 0;
        loop();
    }
    if (drove && !deadman_drives(&deadman))
        release();
    store_tick();
    link_tick();
}

bool robot_tell(uint16_t longest_us)
{
    return telemetry_tick(&deadman, faults, longest_us);
}
