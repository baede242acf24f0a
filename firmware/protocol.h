/* Made from firmware/protocol.yaml by firmware/generate.py; change those. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdbool.h>
#include <stdint.h>

#include "fields.h"

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
#define GLITCH_MAXIMUM 50000
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
extern const field_t command_fields[];
static inline void command_pack(const command_t *from, uint8_t *bytes)
{
    fields_pack(command_fields, 1, from, bytes);
}
static inline bool command_unpack(command_t *to, const uint8_t *bytes)
{
    return fields_unpack(command_fields, to, bytes);
}

/* raw duty for identification */
typedef struct {
    uint8_t sequence; /* number of this command */
    int16_t left; /* 1/16383 */
    int16_t right; /* 1/16383 */
} duty_t;

enum { TYPE_DUTY = 2, SIZE_DUTY = 5 };
extern const field_t duty_fields[];
static inline void duty_pack(const duty_t *from, uint8_t *bytes)
{
    fields_pack(duty_fields, 2, from, bytes);
}
static inline bool duty_unpack(duty_t *to, const uint8_t *bytes)
{
    return fields_unpack(duty_fields, to, bytes);
}

/* motors off; also claims the commands when nobody owns them */
typedef struct {
    uint8_t sequence; /* number of this command */
    uint8_t guard; /* always 0x2A */
} stop_t;

enum { TYPE_STOP = 3, SIZE_STOP = 2 };
extern const field_t stop_fields[];
static inline void stop_pack(const stop_t *from, uint8_t *bytes)
{
    fields_pack(stop_fields, 3, from, bytes);
}
static inline bool stop_unpack(stop_t *to, const uint8_t *bytes)
{
    return fields_unpack(stop_fields, to, bytes);
}

/* asks for hello, and for telemetry from now on */
typedef struct {
    uint8_t version; /* the host's protocol version */
    uint8_t guard; /* always 0xA */
} ask_t;

enum { TYPE_ASK = 4, SIZE_ASK = 2 };
extern const field_t ask_fields[];
static inline void ask_pack(const ask_t *from, uint8_t *bytes)
{
    fields_pack(ask_fields, 4, from, bytes);
}
static inline bool ask_unpack(ask_t *to, const uint8_t *bytes)
{
    return fields_unpack(ask_fields, to, bytes);
}

/* a small deed */
typedef struct {
    uint8_t action; /* code */
    uint8_t value; /* its argument */
} action_t;

enum { TYPE_ACTION = 5, SIZE_ACTION = 2 };
extern const field_t action_fields[];
static inline void action_pack(const action_t *from, uint8_t *bytes)
{
    fields_pack(action_fields, 5, from, bytes);
}
static inline bool action_unpack(action_t *to, const uint8_t *bytes)
{
    return fields_unpack(action_fields, to, bytes);
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
extern const field_t settings_fields[];
static inline void settings_pack(const settings_t *from, uint8_t *bytes)
{
    fields_pack(settings_fields, 6, from, bytes);
}
static inline bool settings_unpack(settings_t *to, const uint8_t *bytes)
{
    return fields_unpack(settings_fields, to, bytes);
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
extern const field_t state_fields[];
static inline void state_pack(const state_t *from, uint8_t *bytes)
{
    fields_pack(state_fields, 8, from, bytes);
}
static inline bool state_unpack(state_t *to, const uint8_t *bytes)
{
    return fields_unpack(state_fields, to, bytes);
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
extern const field_t counts_fields[];
static inline void counts_pack(const counts_t *from, uint8_t *bytes)
{
    fields_pack(counts_fields, 9, from, bytes);
}
static inline bool counts_unpack(counts_t *to, const uint8_t *bytes)
{
    return fields_unpack(counts_fields, to, bytes);
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
extern const field_t status_fields[];
static inline void status_pack(const status_t *from, uint8_t *bytes)
{
    fields_pack(status_fields, 10, from, bytes);
}
static inline bool status_unpack(status_t *to, const uint8_t *bytes)
{
    return fields_unpack(status_fields, to, bytes);
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
extern const field_t hello_fields[];
static inline void hello_pack(const hello_t *from, uint8_t *bytes)
{
    fields_pack(hello_fields, 11, from, bytes);
}
static inline bool hello_unpack(hello_t *to, const uint8_t *bytes)
{
    return fields_unpack(hello_fields, to, bytes);
}

/* what became of the settings sent */
typedef struct {
    uint8_t refusal; /* code */
    uint8_t field; /* number of the field that was refused, in the order of the settings frame */
    uint32_t settings; /* checksum of the settings now in use, 0 without */
} answer_t;

enum { TYPE_ANSWER = 12, SIZE_ANSWER = 5 };
extern const field_t answer_fields[];
static inline void answer_pack(const answer_t *from, uint8_t *bytes)
{
    fields_pack(answer_fields, 12, from, bytes);
}
static inline bool answer_unpack(answer_t *to, const uint8_t *bytes)
{
    return fields_unpack(answer_fields, to, bytes);
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
extern const field_t capture_fields[];
static inline void capture_pack(const capture_t *from, uint8_t *bytes)
{
    fields_pack(capture_fields, 13, from, bytes);
}
static inline bool capture_unpack(capture_t *to, const uint8_t *bytes)
{
    return fields_unpack(capture_fields, to, bytes);
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
