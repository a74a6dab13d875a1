/* The built-in table, byte for byte the file that `workbench export` writes. */
    .section .rodata.table, "a"
    .balign 4
    .global built_in_table, built_in_table_bytes
built_in_table_bytes:
    .word end - built_in_table
built_in_table:
    .incbin TABLE
end:
