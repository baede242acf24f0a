/* Registers of the RP2040 (data sheet, sections 2 and 4). */
#ifndef RP2040_REGISTERS_H
#define RP2040_REGISTERS_H

#include <stdbool.h>
#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
/* The same register for writes that set or clear the bits which are 1 (section 2.1.2). */
#define SET(address) REGISTER((address) + 0x2000u)
#define CLEAR(address) REGISTER((address) + 0x3000u)

#define RESETS 0x4000C000u
#define RESETS_DONE (RESETS + 8)
enum {
    RESET_ADC = 1 << 0, RESET_I2C0 = 1 << 3, RESET_IO_BANK0 = 1 << 5, RESET_IO_QSPI = 1 << 6,
    RESET_PADS_BANK0 = 1 << 8, RESET_PADS_QSPI = 1 << 9, RESET_PLL_USB = 1 << 13, RESET_PWM = 1 << 14,
    RESET_TIMER = 1 << 21, RESET_UART0 = 1 << 22, RESET_USB = 1 << 24,
};

/* Registers that are a pin each. */
#define IO_CTRL(pin) (0x40014004u + 8 * (pin))
#define IO_EDGES 0x400140F0u   /* INTR: four bits a pin, eight pins a register */
#define IO_ENABLED 0x40014100u /* PROC0_INTE */
#define IO_RAISED 0x40014120u  /* PROC0_INTS */
enum { EDGE_LOW_BIT = 4, EDGE_HIGH_BIT = 8, EDGE_BITS = 12 };
enum { FUNCTION_UART = 2, FUNCTION_I2C = 3, FUNCTION_PWM = 4, FUNCTION_SIO = 5, FUNCTION_NONE = 31 };
#define PAD(pin) (0x4001C004u + 4 * (pin))
enum { PAD_SCHMITT = 2, PAD_PULL_DOWN = 4, PAD_PULL_UP = 8, PAD_4_MA = 0x10, PAD_INPUT = 0x40, PAD_NO_OUTPUT = 0x80 };

#define SIO_LEVELS 0xD0000004u
#define SIO_OUTPUT 0xD0000010u    /* after it: set, clear */
#define SIO_DIRECTION 0xD0000020u /* after it: set, clear */
enum { SIO_SET = 4, SIO_CLEAR = 8 };

#define PWM_SLICE(slice) (0x40050000u + 0x14 * (slice))
enum { PWM_CONTROL = 0, PWM_DIVISOR = 4, PWM_COMPARE = 0xC, PWM_TOP = 0x10 };

#define TIMER 0x40054000u
#define TIMER_ALARM(alarm) (TIMER + 0x10 + 4 * (alarm))
#define TIMER_HIGH (TIMER + 0x24)
#define TIMER_LOW (TIMER + 0x28)
#define TIMER_ARMED (TIMER + 0x20)
#define TIMER_RAISED (TIMER + 0x34)
#define TIMER_ENABLED (TIMER + 0x38)

#define WATCHDOG 0x40058000u
#define WATCHDOG_LOAD (WATCHDOG + 4)
#define WATCHDOG_REASON (WATCHDOG + 8)
#define WATCHDOG_TICK (WATCHDOG + 0x2C)
#define POWER_WATCHED 0x40010008u /* WDSEL of the power-on state machine */
#define CHIP_RESET 0x40064008u

#define CLOCKS 0x40008000u
#define PLL_USB 0x4002C000u
#define CRYSTAL 0x40024000u

#define UART0 0x40034000u
enum {
    UART_DATA = 0, UART_FLAGS = 0x18, UART_WHOLE = 0x24, UART_FRACTION = 0x28, UART_FORMAT = 0x2C,
    UART_CONTROL = 0x30, UART_MASK = 0x38, UART_RAISED = 0x40, UART_CLEAR = 0x44,
};
enum { UART_FULL = 1 << 5 };                    /* of the flags: no room to send */
enum { UART_RECEIVES = 1 << 4, UART_SENDS = 1 << 5 }; /* interrupts */

#define ADC 0x4004C000u
enum { ADC_CONTROL = 0, ADC_QUEUE_CONTROL = 8, ADC_QUEUE = 0xC, ADC_ENABLED = 0x18 };

#define I2C0 0x40044000u

/* The flash memory behind a serial unit, which also makes it readable as memory. */
#define FLASH 0x10000000u
#define SSI 0x18000000u
enum { SSI_CONTROL = 0, SSI_ENABLE = 8, SSI_SLAVE = 0x10, SSI_DIVISOR = 0x14, SSI_STATUS = 0x28, SSI_DATA = 0x60 };
#define SELECT_CTRL 0x4001800Cu /* of the flash's select line */

#define INTERRUPTS_ON 0xE000E100u
#define INTERRUPTS_RAISED 0xE000E200u
#define INTERRUPT_PRIORITIES 0xE000E400u /* four interrupts a register, a byte each; 0 comes first */
enum { INTERRUPT_TIMER_0, INTERRUPT_TIMER_1, INTERRUPT_USB = 5, INTERRUPT_PINS = 13, INTERRUPT_UART0 = 20, INTERRUPT_ADC = 22 };

/* Edges of the pins that are watched. */
#define PINS_PER_REGISTER 8
#define EDGE_REGISTERS 3 /* for GP0 to GP23 */
typedef struct {
    uint32_t raised[EDGE_REGISTERS];
} edges_t;

/* True when one has come at this pin; at that of board_watch. */
static inline bool rp2040_changed(const edges_t *edges, uint8_t number)
{
    return number < PINS_PER_REGISTER * EDGE_REGISTERS
        && edges->raised[number / PINS_PER_REGISTER] >> 4 * (number % PINS_PER_REGISTER) & EDGE_BITS;
}
bool rp2040_watched_changed(const edges_t *edges);

/* Sets an alarm again that its module has not. */
void rp2040_repeat(uint8_t alarm);

/* Parts of the start. */
void rp2040_start(uint32_t parts); /* ends their reset */
void rp2040_start_clocks(void);
void rp2040_begin_store(void);
#define IDENTITY_BYTES 8
void rp2040_read_identity(uint8_t *identity); /* of the flash memory, after rp2040_begin_store */

/* Resets the chip into BOOTSEL, where it waits for a program; its pins are inputs then. */
void rp2040_boot_from_usb(void);

/* Called by the start code and by interrupts. */
void rp2040_begin(void);
void failed(void);
void timer_millisecond(void);
void timer_sample(void);
void pins_changed(void);
void uart_ready(void);
void usb_ready(void);
void analog_ready(void);

#endif
