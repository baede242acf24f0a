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
/* A wheel without an edge for this long stands still. */
#define REST_MS 300
/* The button must be seen for this long, so that a spike of the motors is no press. */
#define PRESS_MS 3

static deadman_t deadman;
static settings_t settings;
static uint8_t payload_in_use[SIZE_SETTINGS];
static uint32_t settings_mark; /* checksum of the settings in use; 0 without */
static speed_t wheels[2];
static speed_gains_t gains[2];
static uint32_t limit; /* of the dead-man, ticks */
static uint8_t faults, period_ms, press_ms;
static uint16_t rest_ms;
static pin_t button, light;
static bool lit;

static void release(void)
{
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        speed_stop(&wheels[wheel]);
        encoders_forget(wheel);
        motors_set(wheel, 0);
    }
}

static void gain(uint8_t wheel, uint16_t start, uint16_t forward)
{
    gains[wheel] = (speed_gains_t){start, forward, settings.proportional, settings.integral,
                                   speed_pitch(settings.slots)};
}

static void watch_button(void)
{
    if (settings.button == PIN_NONE || !board_pin(settings.button, &button))
        return;
    volatile uint8_t *in = (volatile uint8_t *)button.port;
    in[1] &= (uint8_t)~button.mask;
    in[2] |= button.mask;
}

static void use(const uint8_t *payload)
{
    memcpy(payload_in_use, payload, SIZE_SETTINGS);
    settings_mark = codec_check(payload, SIZE_SETTINGS);
    limit = settings.deadman * (TICKS_PER_SECOND / 1000);
    gain(0, settings.left_start, settings.left_gain);
    gain(1, settings.right_start, settings.right_gain);
    faults = 0;
    motors_configure(&settings);
    encoders_configure(&settings);
    analog_configure(&settings);
    telemetry_configure(&settings);
    watch_button();
    link_baud(1, settings.baud);
    release();
    deadman_ready(&deadman);
}

static bool resting(void)
{
    return rest_ms >= REST_MS && wheels[0].duty == 0 && wheels[1].duty == 0;
}

static uint8_t take(uint8_t link, const uint8_t *payload, uint8_t *field)
{
    settings_t wanted;
    *field = 0;
    if (!deadman_allows(&deadman, link))
        return REFUSAL_OWNED;
    if (deadman.mode != MODE_UNSET && !resting())
        return REFUSAL_MOVING;
    if (!settings_unpack(&wanted, payload))
        return REFUSAL_RANGE;
    uint8_t refusal = settings_check(&wanted, field);
    if (refusal != REFUSAL_NONE)
        return refusal;
    bool same = settings_mark != 0 && memcmp(payload, payload_in_use, SIZE_SETTINGS) == 0;
    settings = wanted;
    use(payload);
    if (!same)
        store_begin(payload);
    return REFUSAL_NONE;
}

static void answer(uint8_t link, const uint8_t *payload)
{
    uint8_t out[SIZE_ANSWER];
    answer_t frame = {0};
    frame.refusal = take(link, payload, &frame.field);
    frame.settings = settings_mark;
    answer_pack(&frame, out);
    link_send(link, out, SIZE_ANSWER);
}

static void hello(uint8_t link)
{
    uint8_t out[SIZE_HELLO];
    hello_t frame = {
        .version = PROTOCOL_VERSION, .major = VERSION_MAJOR, .minor = VERSION_MINOR,
        .patch = VERSION_PATCH, .board = board_code, .boot = reset_boot(), .reset = reset_cause,
        .mode = deadman.mode, .uart = link != 0, .settings = settings_mark,
    };
    hello_pack(&frame, out);
    link_send(link, out, SIZE_HELLO);
}

void robot_start(void)
{
    uint8_t payload[SIZE_SETTINGS];
    uint8_t field;
    deadman_begin(&deadman);
    if (store_load(payload) && settings_unpack(&settings, payload)
        && settings_check(&settings, &field) == REFUSAL_NONE)
        use(payload);
    link_tick();
    for (uint8_t link = 0; link < LINKS; link++)
        hello(link); /* a host that was driving learns at once that the board has restarted */
}

static void face(uint8_t wheel, int16_t wanted)
{
    if (wanted != 0)
        encoders_direct(wheel, wanted > 0 ? 1 : -1);
}

static void drive(uint8_t link, const uint8_t *payload)
{
    command_t frame;
    if (!command_unpack(&frame, payload))
        return;
    bool from_duty = deadman.mode == MODE_DUTY;
    if (!deadman_command(&deadman, link, MODE_SPEED, frame.sequence, clock_now()))
        return;
    if (from_duty)
        release();
    const int16_t targets[2] = {frame.left, frame.right};
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        speed_edges_t edges = encoders_edges(wheel);
        if (speed_command(&wheels[wheel], &gains[wheel], edges, targets[wheel]))
            encoders_forget(wheel);
        face(wheel, targets[wheel]);
        motors_set(wheel, wheels[wheel].duty);
    }
}

static void drive_raw(uint8_t link, const uint8_t *payload)
{
    duty_t frame;
    if (!duty_unpack(&frame, payload))
        return;
    if (!deadman_command(&deadman, link, MODE_DUTY, frame.sequence, clock_now()))
        return;
    const int16_t duties[2] = {frame.left, frame.right};
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        int32_t scaled = (int32_t)duties[wheel] * DUTY_FULL / DUTY_ONE;
        wheels[wheel].duty = (int16_t)(scaled > DUTY_FULL ? DUTY_FULL
                                       : scaled < -DUTY_FULL ? -DUTY_FULL : scaled);
        face(wheel, duties[wheel]);
        motors_set(wheel, wheels[wheel].duty);
    }
}

static void stop(uint8_t link, const uint8_t *payload)
{
    stop_t frame;
    if (!stop_unpack(&frame, payload) || frame.guard != 0x2A)
        return;
    release();
    deadman_stop(&deadman, link, frame.sequence, clock_now());
}

static void set_light(uint8_t how)
{
    board_pin(LIGHT_PIN, &light);
    volatile uint8_t *in = (volatile uint8_t *)light.port;
    lit = how == 2 ? !lit : how != 0;
    in[1] |= light.mask;
    if (lit)
        in[2] |= light.mask;
    else
        in[2] &= (uint8_t)~light.mask;
}

/* Pin 13 is the light only as long as the settings leave it free. */
static bool light_is_free(void)
{
    const uint8_t taken[] = {settings.left_enable, settings.left_in1, settings.left_in2,
                             settings.right_enable, settings.right_in1, settings.right_in2,
                             settings.left_encoder_b, settings.right_encoder_b, settings.button};
    return settings_mark == 0 || !memchr(taken, LIGHT_PIN, sizeof taken);
}

static void act(uint8_t link, const uint8_t *payload)
{
    action_t frame;
    if (!action_unpack(&frame, payload))
        return;
    if (frame.action == ACTION_LIGHT && light_is_free())
        set_light(frame.value);
    if (!deadman_allows(&deadman, link))
        return;
    if (frame.action == ACTION_CLEAR) {
        faults = 0;
        deadman_clear(&deadman);
    }
    if (frame.action == ACTION_CAPTURE)
        telemetry_capture(frame.value != 0);
}

void robot_obey(uint8_t link, const uint8_t *payload)
{
    switch (payload[0] >> 4) {
    case TYPE_COMMAND:
        drive(link, payload);
        break;
    case TYPE_DUTY:
        drive_raw(link, payload);
        break;
    case TYPE_STOP:
        stop(link, payload);
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
    if (settings_mark != 0 && settings.button != PIN_NONE) {
        volatile uint8_t *in = (volatile uint8_t *)button.port;
        pressed = ((*in & button.mask) != 0) == settings.button_high;
    }
    if (!pressed)
        press_ms = 0;
    else if (press_ms < PRESS_MS)
        press_ms++;
    deadman_button(&deadman, press_ms == PRESS_MS);
}

static void loop(void)
{
    bool still = true;
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        bool edge = encoders_moved(wheel);
        still = still && !edge && wheels[wheel].duty == 0;
        if (deadman.mode == MODE_SPEED) {
            speed_step(&wheels[wheel], &gains[wheel], encoders_edges(wheel));
            motors_set(wheel, wheels[wheel].duty);
        }
        if (speed_stalled(&wheels[wheel], wheels[wheel].duty, edge))
            faults |= (uint8_t)(1 << wheel);
    }
    if (!still)
        rest_ms = 0;
    else if (rest_ms < REST_MS)
        rest_ms += SPEED_PERIOD_MS;
    if (faults && deadman_drives(&deadman))
        deadman_fault(&deadman);
}

void robot_tick(void)
{
    bool drove = deadman_drives(&deadman);
    check_button();
    if (settings_mark != 0)
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

void robot_tell(uint16_t longest_us)
{
    telemetry_tick(&deadman, faults, longest_us);
}
