// The reset of a Cortex-M7 on QEMU's mps2-an500: the floating-point unit on, then main(). The
// semihosting library of newlib (rdimon) prints and exits.
#include <stdint.h>
#include <stdlib.h>

extern uint32_t stack_top;
int main(void);
void initialise_monitor_handles(void);
void __libc_init_array(void);
void _init(void) {}
void _fini(void) {}

void reset(void) {
  *(volatile uint32_t*)0xE000ED88 |= 0xFu << 20;  // CPACR: CP10 and CP11
  __asm__ volatile("dsb\n isb");
  initialise_monitor_handles();
  __libc_init_array();
  exit(main());
}

void fault(void) { exit(3); }

__attribute__((section(".vectors"), used)) static const void* const vectors[16] = {
    &stack_top, reset, fault, fault, fault, fault, fault};
