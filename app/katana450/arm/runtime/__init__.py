"""The running arm: clock, mailbox and control loop. All threads of the arm meet here."""
