/* Start of the RP2040. The chip's boot ROM checks the first 256 bytes of the flash by the checksum at their
   end, copies them to RAM and runs them: they make the flash readable as memory. The program is then
   copied to RAM and runs there alone, since settings are written into the flash while it runs. */
    .syntax unified
    .cpu cortex-m0plus
    .thumb

/* Plain serial reading, command 03, which every flash chip knows (data sheet, section 4.10). */
    .section .boot, "ax"
    .global boot
boot:
    ldr r3, =0x18000000 /* the serial unit */
    movs r1, #0
    str r1, [r3, #0x08] /* off */
    movs r1, #4
    str r1, [r3, #0x14] /* a quarter of the system clock */
    ldr r1, =0x001F0300 /* one data line, 32 bits a frame, read after a command */
    str r1, [r3, #0x00]
    ldr r1, =0x03000218 /* command 03: 8 bits of command, 24 bits of address */
    ldr r0, =0x180000F4
    str r1, [r0]
    movs r1, #0
    str r1, [r3, #0x04] /* one frame a reading */
    movs r1, #1
    str r1, [r3, #0x10]
    str r1, [r3, #0x08] /* on */
    ldr r0, =flash_vectors
    ldmia r0!, {r1, r2}
    msr msp, r1
    bx r2
    .pool

    .section .copier, "ax"
    .word _stack
    .word copier + 1
flash_vectors = . - 8
    .thumb_func
    .global copier
copier:
    ldr r0, =_program_flash
    ldr r1, =_program
    ldr r2, =_program_end
1:  ldmia r0!, {r3}
    stmia r1!, {r3}
    cmp r1, r2
    blo 1b
    ldr r1, =_zeroed
    ldr r2, =_zeroed_end
    movs r3, #0
2:  stmia r1!, {r3}
    cmp r1, r2
    blo 2b
    ldr r0, =0xE000ED08 /* VTOR */
    ldr r1, =_program
    str r1, [r0]
    ldr r0, =rp2040_begin
    blx r0
    ldr r0, =main
    bx r0
    .pool

/* Sixteen exceptions of the core, then the chip's interrupts. */
    .section .vectors, "a"
    .word _stack
    .word copier + 1
    .rept 14
    .word failed
    .endr
    .word timer_millisecond, timer_sample
    .rept 3
    .word failed
    .endr
    .word usb_ready
    .rept 7
    .word failed
    .endr
    .word pins_changed
    .rept 6
    .word failed
    .endr
    .word uart_ready
    .word failed
    .word analog_ready
    .rept 3
    .word failed
    .endr

/* Functions that the compiler calls for structures. */
    .section .text.memory, "ax"
    .thumb_func
    .global memcpy
memcpy:
    cmp r2, #0
    beq 2f
1:  subs r2, #1
    ldrb r3, [r1, r2]
    strb r3, [r0, r2]
    bne 1b
2:  bx lr

    .thumb_func
    .global memset
memset:
    cmp r2, #0
    beq 2f
1:  subs r2, #1
    strb r1, [r0, r2]
    bne 1b
2:  bx lr
