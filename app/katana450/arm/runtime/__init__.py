"""The running arm: clock, mailbox, control loop. The one place where threads meet."""
