/* Made from firmware/protocol.yaml by firmware/generate.py; change those. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdbool.h>
#include <stdint.h>

#include "bits.h"

#define PROTOCOL_VERSION 1
#define CHECK_POLYNOMIAL 0x5D6DCBUL
#define CHECK_START 0xFEDCBAUL
#define CHECK_BYTES 3
#define TICK_NANOSECONDS 64000
#define SPEED_ONE 256
#define DUTY_ONE 16383
#define GAIN_ONE 32768
#define COMMAND_AGE_NANOSECONDS 512000
#define AGE_NONE 65535
#define COMMAND_AGE_NONE 1023
#define ANALOG_ONE 4092
#define ANALOG_NONE 4095
#define PIN_NONE 255
#define DEADMAN_MINIMUM 100
#define DEADMAN_MAXIMUM 500
#define TELEMETRY_MAXIMUM 100
#define GLITCH_MAXIMUM 20000
#define CAPTURE_EDGES 8
#define CAPTURE_FILLER 16383
#define PAYLOAD_LONGEST 35

enum { MODE_UNSET = 0, MODE_STOPPED = 1, MODE_SPEED = 2, MODE_DUTY = 3, MODE_EXPIRED = 4, MODE_FAULT = 5, MODE_OVERRULED = 6, MODE_BUTTON = 7 };
enum { RESET_UNKNOWN = 0, RESET_POWER = 1, RESET_LINE = 2, RESET_BROWNOUT = 3, RESET_WATCHDOG = 4 };
enum { REFUSAL_NONE = 0, REFUSAL_MOVING = 1, REFUSAL_PIN_MISSING = 2, REFUSAL_PIN_LINK = 3, REFUSAL_PIN_PWM = 4, REFUSAL_PIN_INTERRUPT = 5, REFUSAL_PIN_ANALOG = 6, REFUSAL_PIN_TWICE = 7, REFUSAL_RANGE = 8, REFUSAL_OWNED = 9 };
enum { ACTION_LIGHT = 0, ACTION_CLEAR = 1, ACTION_CAPTURE = 2 };
enum { BOARD_UNKNOWN = 0, BOARD_MEGA2560 = 1 };
enum { EDGE_RISING = 0, EDGE_FALLING = 1, EDGE_BOTH = 2 };
enum { BAUD_B9600 = 0, BAUD_B19200 = 1, BAUD_B38400 = 2, BAUD_B57600 = 3, BAUD_B115200 = 4 };

/* wheel speeds; 10 bytes on the wire */
typedef struct {
    uint8_t sequence; /* number of this command */
    int16_t left; /* 1/256 rad/s */
    int16_t right; /* 1/256 rad/s */
} command_t;

enum { TYPE_COMMAND = 1, SIZE_COMMAND = 5 };
static inline void command_pack(const command_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 1, 4);
    bits_put(&at, (uint32_t)from->sequence, 6);
    bits_put(&at, (uint32_t)from->left, 15);
    bits_put(&at, (uint32_t)from->right, 15);
    bits_end(&at);
}
static inline bool command_unpack(command_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->sequence = (uint8_t)bits_get(&at, 6);
    to->left = (int16_t)bits_get_signed(&at, 15);
    to->right = (int16_t)bits_get_signed(&at, 15);
    return bits_rest_is_zero(&at);
}

/* raw duty for identification */
typedef struct {
    uint8_t sequence; /* number of this command */
    int16_t left; /* 1/16383 */
    int16_t right; /* 1/16383 */
} duty_t;

enum { TYPE_DUTY = 2, SIZE_DUTY = 5 };
static inline void duty_pack(const duty_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 2, 4);
    bits_put(&at, (uint32_t)from->sequence, 6);
    bits_put(&at, (uint32_t)from->left, 15);
    bits_put(&at, (uint32_t)from->right, 15);
    bits_end(&at);
}
static inline bool duty_unpack(duty_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->sequence = (uint8_t)bits_get(&at, 6);
    to->left = (int16_t)bits_get_signed(&at, 15);
    to->right = (int16_t)bits_get_signed(&at, 15);
    return bits_rest_is_zero(&at);
}

/* motors off; also claims the commands when nobody owns them */
typedef struct {
    uint8_t sequence; /* number of this command */
    uint8_t guard; /* always 0x2A */
} stop_t;

enum { TYPE_STOP = 3, SIZE_STOP = 2 };
static inline void stop_pack(const stop_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 3, 4);
    bits_put(&at, (uint32_t)from->sequence, 6);
    bits_put(&at, (uint32_t)from->guard, 6);
    bits_end(&at);
}
static inline bool stop_unpack(stop_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->sequence = (uint8_t)bits_get(&at, 6);
    to->guard = (uint8_t)bits_get(&at, 6);
    return bits_rest_is_zero(&at);
}

/* asks for hello, and for telemetry from now on */
typedef struct {
    uint8_t version; /* the host's protocol version */
    uint8_t guard; /* always 0xA */
} ask_t;

enum { TYPE_ASK = 4, SIZE_ASK = 2 };
static inline void ask_pack(const ask_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 4, 4);
    bits_put(&at, (uint32_t)from->version, 8);
    bits_put(&at, (uint32_t)from->guard, 4);
    bits_end(&at);
}
static inline bool ask_unpack(ask_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->version = (uint8_t)bits_get(&at, 8);
    to->guard = (uint8_t)bits_get(&at, 4);
    return bits_rest_is_zero(&at);
}

/* a small deed */
typedef struct {
    uint8_t action; /* code */
    uint8_t value; /* its argument */
} action_t;

enum { TYPE_ACTION = 5, SIZE_ACTION = 2 };
static inline void action_pack(const action_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 5, 4);
    bits_put(&at, (uint32_t)from->action, 4);
    bits_put(&at, (uint32_t)from->value, 8);
    bits_end(&at);
}
static inline bool action_unpack(action_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->action = (uint8_t)bits_get(&at, 4);
    to->value = (uint8_t)bits_get(&at, 8);
    return bits_rest_is_zero(&at);
}

/* everything the firmware must know of the robot; also the content of an EEPROM slot */
typedef struct {
    uint8_t left_enable; /* pin with PWM */
    uint8_t left_in1; /* pin */
    uint8_t left_in2; /* pin */
    uint8_t left_encoder; /* pin with an interrupt */
    uint8_t left_encoder_b; /* pin of the second channel, or none */
    uint8_t right_enable; /* pin with PWM */
    uint8_t right_in1; /* pin */
    uint8_t right_in2; /* pin */
    uint8_t right_encoder; /* pin with an interrupt */
    uint8_t right_encoder_b; /* pin of the second channel, or none */
    uint8_t range; /* analog channel (A0 is 0), or none */
    uint8_t battery; /* analog channel, or none */
    uint8_t button; /* pin of the stop button, or none */
    bool left_reversed; /* the motor's wires are swapped */
    bool right_reversed; /* the motor's wires are swapped */
    bool enable_inverted; /* the driver is enabled by a low level */
    bool brake; /* brake at rest rather than coast */
    bool button_high; /* pressed is high (a normally closed contact to ground) */
    bool encoder_reversed_left; /* quadrature counts the other way */
    bool encoder_reversed_right; /* quadrature counts the other way */
    bool edge_times; /* state frames rather than counts frames */
    uint8_t edge; /* which edges count */
    uint8_t baud; /* of UART1 */
    uint8_t reserved; /* zero */
    uint16_t slots; /* counts in a turn of the wheel */
    uint16_t glitch; /* us a level must last before the edge that ends it counts */
    uint16_t deadman; /* ms */
    uint8_t telemetry; /* Hz */
    uint16_t left_start; /* duty that just moves the wheel, 1/32768 */
    uint16_t right_start; /* duty that just moves the wheel, 1/32768 */
    uint16_t left_gain; /* duty per rad/s, 1/32768 */
    uint16_t right_gain; /* duty per rad/s, 1/32768 */
    uint16_t proportional; /* duty per rad/s of error, 1/32768 */
    uint16_t integral; /* duty per rad of error, 1/32768 */
} settings_t;

enum { TYPE_SETTINGS = 6, SIZE_SETTINGS = 35 };
enum { FIELD_LEFT_ENABLE, FIELD_LEFT_IN1, FIELD_LEFT_IN2, FIELD_LEFT_ENCODER, FIELD_LEFT_ENCODER_B, FIELD_RIGHT_ENABLE, FIELD_RIGHT_IN1, FIELD_RIGHT_IN2, FIELD_RIGHT_ENCODER, FIELD_RIGHT_ENCODER_B, FIELD_RANGE, FIELD_BATTERY, FIELD_BUTTON, FIELD_LEFT_REVERSED, FIELD_RIGHT_REVERSED, FIELD_ENABLE_INVERTED, FIELD_BRAKE, FIELD_BUTTON_HIGH, FIELD_ENCODER_REVERSED_LEFT, FIELD_ENCODER_REVERSED_RIGHT, FIELD_EDGE_TIMES, FIELD_EDGE, FIELD_BAUD, FIELD_RESERVED, FIELD_SLOTS, FIELD_GLITCH, FIELD_DEADMAN, FIELD_TELEMETRY, FIELD_LEFT_START, FIELD_RIGHT_START, FIELD_LEFT_GAIN, FIELD_RIGHT_GAIN, FIELD_PROPORTIONAL, FIELD_INTEGRAL };
static inline void settings_pack(const settings_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 6, 4);
    bits_put(&at, (uint32_t)from->left_enable, 8);
    bits_put(&at, (uint32_t)from->left_in1, 8);
    bits_put(&at, (uint32_t)from->left_in2, 8);
    bits_put(&at, (uint32_t)from->left_encoder, 8);
    bits_put(&at, (uint32_t)from->left_encoder_b, 8);
    bits_put(&at, (uint32_t)from->right_enable, 8);
    bits_put(&at, (uint32_t)from->right_in1, 8);
    bits_put(&at, (uint32_t)from->right_in2, 8);
    bits_put(&at, (uint32_t)from->right_encoder, 8);
    bits_put(&at, (uint32_t)from->right_encoder_b, 8);
    bits_put(&at, (uint32_t)from->range, 8);
    bits_put(&at, (uint32_t)from->battery, 8);
    bits_put(&at, (uint32_t)from->button, 8);
    bits_put(&at, (uint32_t)from->left_reversed, 1);
    bits_put(&at, (uint32_t)from->right_reversed, 1);
    bits_put(&at, (uint32_t)from->enable_inverted, 1);
    bits_put(&at, (uint32_t)from->brake, 1);
    bits_put(&at, (uint32_t)from->button_high, 1);
    bits_put(&at, (uint32_t)from->encoder_reversed_left, 1);
    bits_put(&at, (uint32_t)from->encoder_reversed_right, 1);
    bits_put(&at, (uint32_t)from->edge_times, 1);
    bits_put(&at, (uint32_t)from->edge, 2);
    bits_put(&at, (uint32_t)from->baud, 3);
    bits_put(&at, (uint32_t)from->reserved, 3);
    bits_put(&at, (uint32_t)from->slots, 16);
    bits_put(&at, (uint32_t)from->glitch, 16);
    bits_put(&at, (uint32_t)from->deadman, 16);
    bits_put(&at, (uint32_t)from->telemetry, 8);
    bits_put(&at, (uint32_t)from->left_start, 16);
    bits_put(&at, (uint32_t)from->right_start, 16);
    bits_put(&at, (uint32_t)from->left_gain, 16);
    bits_put(&at, (uint32_t)from->right_gain, 16);
    bits_put(&at, (uint32_t)from->proportional, 16);
    bits_put(&at, (uint32_t)from->integral, 16);
    bits_end(&at);
}
static inline bool settings_unpack(settings_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->left_enable = (uint8_t)bits_get(&at, 8);
    to->left_in1 = (uint8_t)bits_get(&at, 8);
    to->left_in2 = (uint8_t)bits_get(&at, 8);
    to->left_encoder = (uint8_t)bits_get(&at, 8);
    to->left_encoder_b = (uint8_t)bits_get(&at, 8);
    to->right_enable = (uint8_t)bits_get(&at, 8);
    to->right_in1 = (uint8_t)bits_get(&at, 8);
    to->right_in2 = (uint8_t)bits_get(&at, 8);
    to->right_encoder = (uint8_t)bits_get(&at, 8);
    to->right_encoder_b = (uint8_t)bits_get(&at, 8);
    to->range = (uint8_t)bits_get(&at, 8);
    to->battery = (uint8_t)bits_get(&at, 8);
    to->button = (uint8_t)bits_get(&at, 8);
    to->left_reversed = (bool)bits_get(&at, 1);
    to->right_reversed = (bool)bits_get(&at, 1);
    to->enable_inverted = (bool)bits_get(&at, 1);
    to->brake = (bool)bits_get(&at, 1);
    to->button_high = (bool)bits_get(&at, 1);
    to->encoder_reversed_left = (bool)bits_get(&at, 1);
    to->encoder_reversed_right = (bool)bits_get(&at, 1);
    to->edge_times = (bool)bits_get(&at, 1);
    to->edge = (uint8_t)bits_get(&at, 2);
    to->baud = (uint8_t)bits_get(&at, 3);
    to->reserved = (uint8_t)bits_get(&at, 3);
    to->slots = (uint16_t)bits_get(&at, 16);
    to->glitch = (uint16_t)bits_get(&at, 16);
    to->deadman = (uint16_t)bits_get(&at, 16);
    to->telemetry = (uint8_t)bits_get(&at, 8);
    to->left_start = (uint16_t)bits_get(&at, 16);
    to->right_start = (uint16_t)bits_get(&at, 16);
    to->left_gain = (uint16_t)bits_get(&at, 16);
    to->right_gain = (uint16_t)bits_get(&at, 16);
    to->proportional = (uint16_t)bits_get(&at, 16);
    to->integral = (uint16_t)bits_get(&at, 16);
    return bits_rest_is_zero(&at);
}

/* both wheels at one moment, with the ages of their last edges */
typedef struct {
    uint8_t sequence; /* counts frames of this kind */
    uint8_t boot; /* changes at each restart */
    uint8_t mode; /* code */
    bool dropped; /* a frame found no room since the last one */
    uint16_t time; /* 64 us, low bits */
    uint16_t left; /* low bits of the count */
    uint16_t right; /* low bits of the count */
    uint16_t range; /* the analog sensor, mean of 16 readings */
    uint8_t command; /* number of the command in force */
    uint16_t command_age; /* 512 us */
    uint16_t left_age; /* 64 us */
    uint16_t right_age; /* 64 us */
    uint8_t reserved; /* zero */
} state_t;

enum { TYPE_STATE = 8, SIZE_STATE = 16 };
static inline void state_pack(const state_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 8, 4);
    bits_put(&at, (uint32_t)from->sequence, 6);
    bits_put(&at, (uint32_t)from->boot, 4);
    bits_put(&at, (uint32_t)from->mode, 3);
    bits_put(&at, (uint32_t)from->dropped, 1);
    bits_put(&at, (uint32_t)from->time, 16);
    bits_put(&at, (uint32_t)from->left, 16);
    bits_put(&at, (uint32_t)from->right, 16);
    bits_put(&at, (uint32_t)from->range, 12);
    bits_put(&at, (uint32_t)from->command, 6);
    bits_put(&at, (uint32_t)from->command_age, 10);
    bits_put(&at, (uint32_t)from->left_age, 16);
    bits_put(&at, (uint32_t)from->right_age, 16);
    bits_put(&at, (uint32_t)from->reserved, 2);
    bits_end(&at);
}
static inline bool state_unpack(state_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->sequence = (uint8_t)bits_get(&at, 6);
    to->boot = (uint8_t)bits_get(&at, 4);
    to->mode = (uint8_t)bits_get(&at, 3);
    to->dropped = (bool)bits_get(&at, 1);
    to->time = (uint16_t)bits_get(&at, 16);
    to->left = (uint16_t)bits_get(&at, 16);
    to->right = (uint16_t)bits_get(&at, 16);
    to->range = (uint16_t)bits_get(&at, 12);
    to->command = (uint8_t)bits_get(&at, 6);
    to->command_age = (uint16_t)bits_get(&at, 10);
    to->left_age = (uint16_t)bits_get(&at, 16);
    to->right_age = (uint16_t)bits_get(&at, 16);
    to->reserved = (uint8_t)bits_get(&at, 2);
    return bits_rest_is_zero(&at);
}

/* the shorter state, for 50 Hz */
typedef struct {
    uint8_t sequence; /* counts frames of this kind */
    uint8_t boot; /* changes at each restart */
    uint8_t mode; /* code */
    bool dropped; /* a frame found no room since the last one */
    uint16_t time; /* 64 us, low bits */
    uint16_t left; /* low bits of the count */
    uint16_t right; /* low bits of the count */
    uint16_t range; /* the analog sensor, mean of 16 readings */
    uint8_t command; /* number of the command in force */
    uint16_t command_age; /* 512 us */
    uint8_t reserved; /* zero */
} counts_t;

enum { TYPE_COUNTS = 9, SIZE_COUNTS = 12 };
static inline void counts_pack(const counts_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 9, 4);
    bits_put(&at, (uint32_t)from->sequence, 6);
    bits_put(&at, (uint32_t)from->boot, 4);
    bits_put(&at, (uint32_t)from->mode, 3);
    bits_put(&at, (uint32_t)from->dropped, 1);
    bits_put(&at, (uint32_t)from->time, 16);
    bits_put(&at, (uint32_t)from->left, 16);
    bits_put(&at, (uint32_t)from->right, 16);
    bits_put(&at, (uint32_t)from->range, 12);
    bits_put(&at, (uint32_t)from->command, 6);
    bits_put(&at, (uint32_t)from->command_age, 10);
    bits_put(&at, (uint32_t)from->reserved, 2);
    bits_end(&at);
}
static inline bool counts_unpack(counts_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->sequence = (uint8_t)bits_get(&at, 6);
    to->boot = (uint8_t)bits_get(&at, 4);
    to->mode = (uint8_t)bits_get(&at, 3);
    to->dropped = (bool)bits_get(&at, 1);
    to->time = (uint16_t)bits_get(&at, 16);
    to->left = (uint16_t)bits_get(&at, 16);
    to->right = (uint16_t)bits_get(&at, 16);
    to->range = (uint16_t)bits_get(&at, 12);
    to->command = (uint8_t)bits_get(&at, 6);
    to->command_age = (uint16_t)bits_get(&at, 10);
    to->reserved = (uint8_t)bits_get(&at, 2);
    return bits_rest_is_zero(&at);
}

/* what changes slowly, once a second */
typedef struct {
    uint32_t uptime; /* s */
    uint8_t reset; /* code */
    bool stored; /* the settings in use are in the EEPROM */
    bool button; /* the stop button is pressed */
    bool left_fault; /* power but no edges */
    bool right_fault; /* power but no edges */
    uint16_t battery; /* analog reading */
    uint16_t free_stack; /* bytes never used */
    uint16_t loop; /* longest pass of the main loop since the last status, us */
    uint16_t left_rejected; /* edges refused by the glitch filter */
    uint16_t right_rejected; /* edges refused by the glitch filter */
    uint16_t damaged; /* frames refused */
    uint8_t foreign; /* commands of a link that did not own them */
    uint8_t dropped; /* frames that found no room */
} status_t;

enum { TYPE_STATUS = 10, SIZE_STATUS = 18 };
static inline void status_pack(const status_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 10, 4);
    bits_put(&at, (uint32_t)from->uptime, 24);
    bits_put(&at, (uint32_t)from->reset, 4);
    bits_put(&at, (uint32_t)from->stored, 1);
    bits_put(&at, (uint32_t)from->button, 1);
    bits_put(&at, (uint32_t)from->left_fault, 1);
    bits_put(&at, (uint32_t)from->right_fault, 1);
    bits_put(&at, (uint32_t)from->battery, 12);
    bits_put(&at, (uint32_t)from->free_stack, 16);
    bits_put(&at, (uint32_t)from->loop, 16);
    bits_put(&at, (uint32_t)from->left_rejected, 16);
    bits_put(&at, (uint32_t)from->right_rejected, 16);
    bits_put(&at, (uint32_t)from->damaged, 16);
    bits_put(&at, (uint32_t)from->foreign, 8);
    bits_put(&at, (uint32_t)from->dropped, 8);
    bits_end(&at);
}
static inline bool status_unpack(status_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->uptime = (uint32_t)bits_get(&at, 24);
    to->reset = (uint8_t)bits_get(&at, 4);
    to->stored = (bool)bits_get(&at, 1);
    to->button = (bool)bits_get(&at, 1);
    to->left_fault = (bool)bits_get(&at, 1);
    to->right_fault = (bool)bits_get(&at, 1);
    to->battery = (uint16_t)bits_get(&at, 12);
    to->free_stack = (uint16_t)bits_get(&at, 16);
    to->loop = (uint16_t)bits_get(&at, 16);
    to->left_rejected = (uint16_t)bits_get(&at, 16);
    to->right_rejected = (uint16_t)bits_get(&at, 16);
    to->damaged = (uint16_t)bits_get(&at, 16);
    to->foreign = (uint8_t)bits_get(&at, 8);
    to->dropped = (uint8_t)bits_get(&at, 8);
    return bits_rest_is_zero(&at);
}

/* who this is */
typedef struct {
    uint8_t version; /* of the protocol */
    uint8_t major; /* of the firmware */
    uint8_t minor; /* of the firmware */
    uint8_t patch; /* of the firmware */
    uint8_t board; /* code */
    uint8_t boot; /* changes at each restart */
    uint8_t reset; /* code */
    uint8_t mode; /* code */
    bool uart; /* which UART this came from */
    uint32_t settings; /* checksum of the settings in use, 0 without */
} hello_t;

enum { TYPE_HELLO = 11, SIZE_HELLO = 10 };
static inline void hello_pack(const hello_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 11, 4);
    bits_put(&at, (uint32_t)from->version, 8);
    bits_put(&at, (uint32_t)from->major, 8);
    bits_put(&at, (uint32_t)from->minor, 8);
    bits_put(&at, (uint32_t)from->patch, 8);
    bits_put(&at, (uint32_t)from->board, 8);
    bits_put(&at, (uint32_t)from->boot, 4);
    bits_put(&at, (uint32_t)from->reset, 4);
    bits_put(&at, (uint32_t)from->mode, 3);
    bits_put(&at, (uint32_t)from->uart, 1);
    bits_put(&at, (uint32_t)from->settings, 24);
    bits_end(&at);
}
static inline bool hello_unpack(hello_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->version = (uint8_t)bits_get(&at, 8);
    to->major = (uint8_t)bits_get(&at, 8);
    to->minor = (uint8_t)bits_get(&at, 8);
    to->patch = (uint8_t)bits_get(&at, 8);
    to->board = (uint8_t)bits_get(&at, 8);
    to->boot = (uint8_t)bits_get(&at, 4);
    to->reset = (uint8_t)bits_get(&at, 4);
    to->mode = (uint8_t)bits_get(&at, 3);
    to->uart = (bool)bits_get(&at, 1);
    to->settings = (uint32_t)bits_get(&at, 24);
    return bits_rest_is_zero(&at);
}

/* what became of the settings sent */
typedef struct {
    uint8_t refusal; /* code */
    uint8_t field; /* number of the field that was refused, in the order of the settings frame */
    uint32_t settings; /* checksum of the settings now in use, 0 without */
} answer_t;

enum { TYPE_ANSWER = 12, SIZE_ANSWER = 5 };
static inline void answer_pack(const answer_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 12, 4);
    bits_put(&at, (uint32_t)from->refusal, 4);
    bits_put(&at, (uint32_t)from->field, 8);
    bits_put(&at, (uint32_t)from->settings, 24);
    bits_end(&at);
}
static inline bool answer_unpack(answer_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->refusal = (uint8_t)bits_get(&at, 4);
    to->field = (uint8_t)bits_get(&at, 8);
    to->settings = (uint32_t)bits_get(&at, 24);
    return bits_rest_is_zero(&at);
}

/* raw edges, both flanks, unfiltered */
typedef struct {
    uint8_t sequence; /* counts frames of this kind */
    bool lost; /* edges found no room */
    uint8_t used; /* entries in use */
    uint32_t time; /* 64 us, time of the first edge */
    uint16_t edges[8]; /* 1 bit wheel (0 left), 1 bit level, 14 bits of 64 us since the edge before */
} capture_t;

enum { TYPE_CAPTURE = 13, SIZE_CAPTURE = 21 };
static inline void capture_pack(const capture_t *from, uint8_t *bytes)
{
    bits_t at = bits_begin(bytes);
    bits_put(&at, 13, 4);
    bits_put(&at, (uint32_t)from->sequence, 6);
    bits_put(&at, (uint32_t)from->lost, 1);
    bits_put(&at, (uint32_t)from->used, 4);
    bits_put(&at, (uint32_t)from->time, 25);
    for (uint8_t i = 0; i < 8; i++)
        bits_put(&at, (uint32_t)from->edges[i], 16);
    bits_end(&at);
}
static inline bool capture_unpack(capture_t *to, const uint8_t *bytes)
{
    bits_t at = bits_begin((uint8_t *)bytes);
    bits_get(&at, 4);
    to->sequence = (uint8_t)bits_get(&at, 6);
    to->lost = (bool)bits_get(&at, 1);
    to->used = (uint8_t)bits_get(&at, 4);
    to->time = (uint32_t)bits_get(&at, 25);
    for (uint8_t i = 0; i < 8; i++)
        to->edges[i] = (uint16_t)bits_get(&at, 16);
    return bits_rest_is_zero(&at);
}

/* Payload length of a type; 0 when there is no such type. */
static inline uint8_t payload_size(uint8_t type)
{
    switch (type) {
    case TYPE_COMMAND: return SIZE_COMMAND;
    case TYPE_DUTY: return SIZE_DUTY;
    case TYPE_STOP: return SIZE_STOP;
    case TYPE_ASK: return SIZE_ASK;
    case TYPE_ACTION: return SIZE_ACTION;
    case TYPE_SETTINGS: return SIZE_SETTINGS;
    case TYPE_STATE: return SIZE_STATE;
    case TYPE_COUNTS: return SIZE_COUNTS;
    case TYPE_STATUS: return SIZE_STATUS;
    case TYPE_HELLO: return SIZE_HELLO;
    case TYPE_ANSWER: return SIZE_ANSWER;
    case TYPE_CAPTURE: return SIZE_CAPTURE;
    default: return 0;
    }
}

#endif
