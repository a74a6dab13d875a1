"""The CM-530 over its serial line: its program, boot loader, PC link, and motions that it plays without the computer."""
